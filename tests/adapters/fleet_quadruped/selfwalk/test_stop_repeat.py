"""A stop is said again for a moment, an emergency stop until the machine is seen to rest."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.selfwalk.stop_repeat import StopRepeat

SHORTLY = 0.2  # s


@pytest.mark.parametrize("resting", [True, False])
def test_any_stop_is_repeated_for_a_moment(resting):
    stop = StopRepeat()
    assert not stop.active(1000.0, resting=resting)
    stop.begin(1000.0)
    assert stop.active(1000.0 + SHORTLY - 0.01, resting=resting)
    assert not stop.active(1000.0 + SHORTLY, resting=resting)


def test_a_newer_stop_is_repeated_from_its_own_begin_and_an_older_one_shortens_nothing():
    stop = StopRepeat()
    stop.begin(1000.1)
    stop.begin(1000.0)
    assert stop.active(1000.25, resting=True)
    stop.begin(1000.2)
    assert stop.active(1000.35, resting=True)


@given(st.lists(st.booleans(), max_size=20))
def test_an_emergency_stop_is_repeated_until_the_machine_rests_after_that_moment_and_no_longer(resting):
    stop = StopRepeat()
    stop.begin(1000.0)
    stop.pending = True
    assert stop.active(1000.1, resting=True), "what it reports may be from before the stop"
    still = True
    for number, rests in enumerate(resting):
        still = still and not rests
        assert stop.active(1001.0 + number, resting=rests) is still
        assert stop.pending is still
