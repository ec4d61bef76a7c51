"""The standing height that is asked of a self-walking machine."""

import math

import pytest

from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk.description import SelfWalker
from fleet_quadruped.selfwalk.height import StandingHeight

UP = [BodyMode.STANDING, BodyMode.WALKING]


@pytest.fixture
def height(walker):
    return StandingHeight(walker)


def test_it_begins_where_the_machine_stands_up(walker, height):
    assert height.value == walker.height


@pytest.mark.parametrize("mode", UP)
def test_a_change_is_sent_as_the_height_that_it_leads_to(walker, height, mode):
    frame, refusal = height.change(0.02, mode)
    assert (frame, refusal) == (walker.wire.height(height.value), "")
    assert height.value == pytest.approx(walker.height + 0.02)
    height.change(-0.03, mode)
    assert height.value == pytest.approx(walker.height - 0.01)


def test_no_change_leads_beyond_what_the_machine_can(walker, height):
    for wanted, most in ((9.0, walker.highest), (-9.0, walker.lowest)):
        frame, refusal = height.change(wanted, BodyMode.STANDING)
        assert (height.value, frame, refusal) == (most, walker.wire.height(most), "")
    height.change(0.01, BodyMode.STANDING)
    assert height.value == pytest.approx(walker.lowest + 0.01), "what was too much is not remembered"


@pytest.mark.parametrize("change", [math.nan, math.inf, -math.inf])
def test_a_change_that_is_no_number_is_refused(walker, height, change):
    assert height.change(change, BodyMode.STANDING) == (None, f"{change} is not a height")
    assert height.value == walker.height


@pytest.mark.parametrize("mode", [mode for mode in BodyMode if mode not in UP])
def test_a_machine_that_does_not_stand_is_told_to_stand_up_first(walker, height, mode):
    assert height.change(0.02, mode) == (None, f"it is {mode.value}; stand up first")
    assert height.value == walker.height


def test_a_machine_without_a_height_says_so(walker):
    tree = walker.model_dump(by_alias=True, exclude_none=True)
    del tree["frames" if walker.frames else "objects"]["height"]
    height = StandingHeight(SelfWalker.model_validate(tree))
    assert height.change(0.02, BodyMode.STANDING) == (None, "this machine's description has no height")
