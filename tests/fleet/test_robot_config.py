"""The fields that every robot has in fleet.yaml: which are refused, and what they mean when left out."""

import math
from uuid import UUID

import pytest
from pydantic import ValidationError

from fleet.robot_config import (
    Accepts,
    AdapterConfig,
    BatteryPolicy,
    FenceConfig,
    Limits,
    Separation,
    WorldOrigin,
)

TWIN, LEADER = UUID(int=1), UUID(int=2)
LED = Accepts(command=frozenset({"tele", "edge_leader"}))
SQUARE = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))


def robot(**given):
    return AdapterConfig(**{"name": "rex", "twin": TWIN, **given})


def refused(model=robot, **given):
    with pytest.raises(ValidationError) as caught:
        model(**given)
    return caught.value.errors()[0]


# -- names, limits, separation ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a", "rex-2_b", "a" + "x" * 62])
def test_a_name_is_a_word_that_fits_a_key_and_a_file(name):
    assert robot(name=name).name == name


@pytest.mark.parametrize(
    "name", ["", "Rex", "2rex", "-rex", "re x", "rex/2", "a" + "x" * 63, "r\u00e9x", "rex\n"]
)
def test_any_other_name_is_refused(name):
    assert refused(name=name)["type"] == "string_pattern_mismatch"


@pytest.mark.parametrize("model", [Limits, Separation])
def test_own_values_stand_over_those_of_the_adapter(model):
    first, second = list(model.model_fields)[:2]
    own, base = model(**{first: 3}), model(**{first: 1, second: 2})
    assert own.over(base) == model(**{first: 3, second: 2})
    assert model().over(base) is base
    assert base.over(model()) == base


@pytest.mark.parametrize("field", list(Limits.model_fields))
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf])
def test_a_limit_is_a_finite_number_above_zero(field, value):
    assert refused(Limits, **{field: value})["loc"] == (field,)


@pytest.mark.parametrize(("value", "valid"), [(0, True), (9, True), (-1, False), (10, False)])
def test_a_precedence_is_a_digit(value, valid):
    if valid:
        assert Separation(precedence=value).precedence == value
    else:
        refused(Separation, precedence=value)


@pytest.mark.parametrize(
    ("field", "low", "high"),
    [
        ("setpoint_lease", 0.15, 5.0),
        ("max_age", 0.001, 60),
        ("command_max_age", 0.001, 600),
        ("clock_skew", 0, 3600),
        ("control_lease", 0, 600),
    ],
)
def test_times_have_bounds(field, low, high):
    for value in (low, high):
        assert getattr(robot(**{field: value}), field) == value
    for value in (low - 0.01, high + 0.01, math.nan, math.inf):
        assert refused(**{field: value})["loc"] == (field,)


def test_what_a_robot_does_not_say_is_cautious():
    config = robot()
    assert (config.setpoint_lease, config.max_age, config.command_max_age) == (0.5, 0.5, 5.0)
    assert (config.clock_skew, config.control_lease, config.legacy_status) == (0.3, 3.0, True)
    assert (config.accepts, config.limits) == (Accepts(), Limits())
    assert (config.fence, config.battery_policy) == (None, None)
    policy = BatteryPolicy()
    assert (policy.reserve, policy.low, policy.action, policy.endurance) == (15.0, 20.0, "warn", None)


# -- the fence ----------------------------------------------------------------------------------------


def test_a_fence_is_polygons_of_corners():
    fence = FenceConfig(inclusion=[[list(corner) for corner in SQUARE]])
    assert (fence.inclusion, fence.exclusion, fence.frame, fence.margin) == ((SQUARE,), (), "world", 1.0)


@pytest.mark.parametrize(
    "polygons", [[[0, 0], [9, 0], [9, 9]], [[[[0, 0]], [[9, 0]], [[9, 9]]]], [[0, [9, 0], [9, 9]]], [5]]
)
def test_a_bracket_too_few_or_too_many_is_one_error_that_shows_the_form(polygons):
    error = refused(FenceConfig, inclusion=polygons)
    assert "a bracket is missing or too many in polygon 1" in error["msg"]
    assert "[[[0, 0], [9, 0], [9, 9]]]" in error["msg"]


@pytest.mark.parametrize(
    "corners",
    [
        SQUARE[:2],
        [(0, 0), (9, 9), (9, 0), (0, 9)],
        [(0, 0), (1, 0), (2, 0)],
        [(0, 0), (9, 0), (9, math.nan)],
        [(0, 0)] * 101,
    ],
)
def test_a_polygon_has_an_area_and_no_crossing_sides(corners):
    refused(FenceConfig, inclusion=[corners])


def test_a_fence_has_at_most_twenty_polygons():
    assert len(FenceConfig(exclusion=[SQUARE] * 20).exclusion) == 20
    refused(FenceConfig, exclusion=[SQUARE] * 21)


@pytest.mark.parametrize(
    ("corner", "valid"),
    [
        ((89.9, 180), True),
        ((-89.9, -180), True),
        ((90, 0), False),
        ((-90, 0), False),
        ((0, 180.1), False),
        ((0, -180.1), False),
    ],
)
@pytest.mark.parametrize("field", ["inclusion", "exclusion"])
def test_geodetic_corners_are_degrees(corner, valid, field):
    polygon = (corner, (1.0, 1.0), (2.0, -1.0))
    if valid:
        FenceConfig(frame="geodetic", **{field: [polygon]})
    else:
        error = refused(FenceConfig, frame="geodetic", **{field: [polygon]})
        assert "geodetic corners are [latitude, longitude] in degrees" in error["msg"]
    FenceConfig(frame="world", **{field: [polygon]})


# -- battery, origin, start ---------------------------------------------------------------------------


def test_percents_are_percents():
    for value in (0, 100):
        assert BatteryPolicy(reserve=value, low=value).low == value
    for value in (-0.1, 100.1, math.nan):
        refused(BatteryPolicy, low=value)
        refused(BatteryPolicy, reserve=value)


@pytest.mark.parametrize(("field", "most"), [("latitude", 90), ("longitude", 180), ("heading", 360)])
def test_an_origin_is_a_place_on_earth(field, most):
    place = {"latitude": 0, "longitude": 0}
    for value in (most, -most):
        assert getattr(WorldOrigin(**{**place, field: value}), field) == value
        refused(WorldOrigin, **{**place, field: value * 1.001})


@pytest.mark.parametrize("heading", [0.0, math.tau, -math.tau])
def test_a_start_places_a_robot_with_a_heading_in_radians(heading):
    assert robot(start=(1.0, 2.0, heading)).start == (1.0, 2.0, heading)


def test_a_heading_of_more_than_a_turn_is_probably_degrees():
    error = refused(start=(0, 0, -90))
    assert error["ctx"] == {
        "reason": "the heading counts in radians: -90 is more than a turn",
        "key": "start",
    }


def test_a_robot_is_placed_by_a_start_or_by_an_origin():
    origin = WorldOrigin(latitude=0, longitude=0)
    assert refused(start=(0, 0, 0), origin=origin)["ctx"]["key"] == "start"
    assert robot(origin=origin).start is None


# -- leaders and followers ----------------------------------------------------------------------------


def test_a_robot_follows_a_leader_whose_state_it_obeys():
    assert robot(follows=LEADER, accepts=LED).follows == LEADER
    assert robot(follows=LEADER, accepts=LED, role="follower").role == "follower"
    assert robot(accepts=LED).follows is None


@pytest.mark.parametrize(
    ("given", "key", "reason"),
    [
        ({"follows": TWIN, "accepts": LED}, "follows", "cannot follow itself"),
        ({"role": "leader", "follows": LEADER, "accepts": LED}, "follows", "a leader is not led"),
        ({"role": "leader", "accepts": LED}, "accepts", "it would follow its own state"),
        ({"follows": LEADER}, "follows", "put edge_leader into accepts.command"),
        (
            {"follows": LEADER, "accepts": Accepts(command=frozenset({"tele"}))},
            "follows",
            "its leader is not obeyed",
        ),
    ],
)
def test_a_leader_that_follows_or_a_follower_that_cannot_is_refused(given, key, reason):
    error = refused(**given)
    assert error["ctx"]["key"] == key
    assert reason in error["ctx"]["reason"]


class Linked(AdapterConfig):
    link: str = ""


@pytest.mark.parametrize(
    ("given", "source_type", "simulated"),
    [
        ({"link": "sim:toy"}, "sim", True),
        ({"link": "sim:toy", "role": "leader"}, "sim", True),
        ({"link": "udp:sim:1"}, "edge", False),
        ({"role": "leader"}, "edge_leader", False),
        ({"role": "follower"}, "edge_follower", False),
    ],
)
def test_the_state_of_a_robot_says_what_it_is(given, source_type, simulated):
    config = Linked(name="rex", twin=TWIN, **given)
    assert (config.source_type, config.simulated) == (source_type, simulated)


def test_a_robot_that_describes_nothing_has_no_plans_parts_timeouts_or_failsafe():
    config = robot()
    assert (config.plans(), config.body_parts()) == (frozenset(), ())
    assert (config.timeout_of("land"), config.failsafe_after, config.simulated) == (None, None, False)
    assert config.source_type == "edge"
