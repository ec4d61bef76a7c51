"""Of two configurations the stricter part of each, so that no robot in motion is let loose by a change."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.source_policy import SourcePolicy
from fleet.host.safety.stricter import (
    as_strict_as_both,
    is_equally_strict,
    is_within,
    may_loosen,
    merge_stricter,
)
from fleet.model.polygon import polygon_contains
from fleet.robot_config import Accepts, AdapterConfig, BatteryPolicy, FenceConfig, Limits, Separation

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
OWN = {"limits": Limits(speed=2.0, yaw_rate=1.0), "separation": Separation(radius=1.0, braking=1.0)}
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
SMALL = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
SHIFTED = ((5.0, 5.0), (15.0, 5.0), (15.0, 15.0), (5.0, 15.0))

figures = st.none() | st.floats(0.1, 50)
senders = st.none() | st.frozensets(st.sampled_from(["tele", "edge", "edit"]))
boxes = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(1, 20), st.floats(1, 20)).map(
    lambda box: (
        (box[0], box[1]),
        (box[0] + box[2], box[1]),
        (box[0] + box[2], box[1] + box[3]),
        (box[0], box[1] + box[3]),
    )
)
fences = st.none() | st.builds(
    FenceConfig,
    inclusion=st.lists(boxes, max_size=2).map(tuple),
    exclusion=st.lists(boxes, max_size=2).map(tuple),
    margin=st.sampled_from([0.0, 1.0, 2.0]),
)
policies = st.none() | st.builds(
    BatteryPolicy, reserve=st.floats(0, 50), low=st.floats(0, 50), endurance=figures
)
configs = st.builds(
    AdapterConfig,
    name=st.just("rex"),
    twin=st.just(TWIN),
    accepts=st.builds(Accepts, command=senders, navigate=senders, mission=senders),
    limits=st.builds(Limits, speed=figures, yaw_rate=figures, altitude=figures, distance=figures),
    fence=fences,
    battery_policy=policies,
    separation=st.builds(Separation, radius=figures, braking=figures),
)


@given(configs, configs)
def test_it_is_as_strict_as_the_old_and_nowhere_looser(old, new):
    both = as_strict_as_both(old, new, **OWN)
    for one in (old, new):
        assert no_looser(both, one)


@given(configs, configs)
def test_a_new_configuration_that_is_held_back_is_nowhere_looser_than_either(old, new):
    kept = merge_stricter(old, new, **OWN)
    for one in (old, new):
        assert no_looser(kept, one)
    if not may_loosen(old, new):
        assert is_equally_strict(kept, new, **OWN)


def no_looser(both, one):
    policy, other = (SourcePolicy(each.accepts, simulated=False) for each in (both, one))
    assert policy.command <= other.command
    assert policy.navigate <= other.navigate
    assert policy.mission <= other.mission
    mine, theirs = both.limits.over(OWN["limits"]), one.limits.over(OWN["limits"])
    assert all((getattr(mine, name) or math.inf) <= (value or math.inf) for name, value in theirs)
    apart, limit = both.separation.over(OWN["separation"]), one.separation.over(OWN["separation"])
    assert (apart.radius >= limit.radius, apart.braking <= limit.braking) == (True, True)
    if one.battery_policy is not None:
        assert both.battery_policy.reserve >= one.battery_policy.reserve
        assert both.battery_policy.low >= one.battery_policy.low
    return True


@given(configs)
def test_of_two_that_are_alike_nothing_is_changed(config):
    assert is_equally_strict(as_strict_as_both(config, config, **OWN), config, *OWN.values())


@given(configs)
def test_a_configuration_that_stays_as_it_is_loosens_nothing_whatever_it_leaves_out(config):
    assert not may_loosen(config, config)


BRAKING = [
    # deceleration before and after (m/s2), None: left out; whether it may be a looser one
    (None, None, False),
    (1.0, 1.0, False),
    (1.0, 0.3, False),
    (0.3, 1.0, True),
    (None, 0.3, True),  # the adapter's own may be weaker
    (0.3, None, True),
    (1.0, None, True),
]


@pytest.mark.parametrize(("before", "after", "loosens"), BRAKING)
def test_a_stronger_braking_and_one_that_is_not_known_may_be_looser(before, after, loosens):
    old, new = (
        AdapterConfig(name="rex", twin=TWIN, separation=Separation(radius=1.0, braking=braking))
        for braking in (before, after)
    )
    assert may_loosen(old, new) is loosens


@given(fences, fences, st.tuples(st.floats(-30, 50), st.floats(-30, 50)))
def test_a_fence_that_is_within_another_lets_a_robot_be_nowhere_else(new, old, point):
    if is_within(new, old) and allowed(new, point):
        assert allowed(old, point)


def allowed(fence, point):
    if fence is None:
        return True
    inside = not fence.inclusion or any(polygon_contains(each, point) for each in fence.inclusion)
    return inside and not any(polygon_contains(each, point) for each in fence.exclusion)


def test_a_fence_is_taken_over_in_motion_only_where_it_is_surely_stricter():
    around = FenceConfig(inclusion=(SQUARE,))
    assert is_within(around, None)
    assert is_within(FenceConfig(inclusion=(SMALL,)), around)
    assert is_within(FenceConfig(inclusion=(SQUARE,), exclusion=(SMALL,)), around)
    assert not is_within(None, around)
    assert not is_within(FenceConfig(inclusion=(SHIFTED,)), around)
    assert not is_within(around, FenceConfig(inclusion=(SQUARE,), exclusion=(SMALL,)))
    assert not is_within(FenceConfig(inclusion=(SQUARE,), margin=0.5), around)


def test_a_robot_that_obeyed_somebody_obeys_nobody_when_both_have_none_in_common():
    old = AdapterConfig(name="rex", twin=TWIN, accepts=Accepts(command=frozenset({"tele"})))
    new = old.model_copy(update={"accepts": Accepts(command=frozenset({"edge"}))})
    both = as_strict_as_both(old, new, **OWN)
    assert SourcePolicy(both.accepts, simulated=False).command == frozenset()
