"""Plans of QGroundControl: what is flown is what was planned, or the file is refused."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.missions.plan import (
    MADE_FOR,
    items_of,
    made_for,
    missing_text,
    plan_in,
    plan_needs,
    plans_taken,
)

HERE = [47.39776, 8.54565, 8]
JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=10,
)


def item(command, params=(0, 0, 0, None), place=(0, 0, 0), frame=3):
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": [*params, *place]}


def plan(*items, **more):
    mission = {"items": list(items), "plannedHomePosition": [47.3977, 8.5455, 488]}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission} | more).encode()


def test_items_are_converted_one_for_one():
    found = plan_in(
        plan(
            item(22),
            item(178, (1, 4.0, -1, 0)),
            item(16, place=HERE),
            item(19, (30, 0, 0, 0), HERE),
            item(18, (3, 0, -10, 0), HERE),
            item(20),
        )
    )
    place = {"latitude": 47.39776, "longitude": 8.54565, "altitude_m": 8}
    assert found["items"] == [
        {"type": "waypoint", **place, "speed_ms": 4.0},
        {"type": "loiter_time", "seconds": 30, **place},
        {"type": "loiter_turns", "turns": 3, "radius_m": 10, "direction": "ccw", **place},
        {"type": "return_to_launch"},
    ]
    assert found["altitude_reference"] == "home"
    assert found["home"] == {"latitude": 47.3977, "longitude": 8.5455, "altitude_amsl_m": 488}


def test_the_landing_pattern_of_a_plane_is_its_start_its_approach_and_its_end():
    pattern = {
        "type": "ComplexItem",
        "complexItemType": "fwLandingPattern",
        "altitudesAreRelative": True,
        "landCoordinate": [47.3970, 8.5450, 0],
        "landingApproachCoordinate": [47.3990, 8.5450, 40],
        "loiterClockwise": False,
        "loiterRadius": 75,
        "useLoiterToAlt": True,
    }
    start, approach, end = plan_in(plan(item(16, place=HERE), pattern))["items"][1:]
    assert start == {"type": "land_start"}
    there = {"latitude": 47.3990, "longitude": 8.5450, "altitude_m": 40}
    assert approach == {"type": "loiter_to_altitude", "radius_m": 75, "direction": "ccw", **there}
    assert end == {"type": "land", "latitude": 47.3970, "longitude": 8.5450, "altitude_m": 0}
    straight = plan_in(plan(item(16, place=HERE), pattern | {"useLoiterToAlt": False}))
    assert straight["items"][2] == {"type": "waypoint", **there}


@pytest.mark.parametrize("kind", ["fwLandingPattern", "vtolLandingPattern"])
def test_the_landing_pattern_of_a_vtol_is_one_like_any_other(kind):
    pattern = {
        "type": "ComplexItem",
        "complexItemType": kind,
        "altitudesAreRelative": True,
        "landCoordinate": [47.3970, 8.5450, 0],
        "landingApproachCoordinate": [47.3990, 8.5450, 40],
        "loiterClockwise": True,
        "loiterRadius": 75,
    }
    found = plan_in(plan(item(84), item(16, place=HERE), pattern))["items"]
    assert [each["type"] for each in found] == ["waypoint", "land_start", "loiter_to_altitude", "land"]


def test_a_take_off_and_a_landing_with_rotors_are_a_way_there_and_a_landing():
    down = item(85, place=(47.3970, 8.5450, 0))
    found = plan_in(plan(item(84, place=HERE), down))["items"]
    assert [each["type"] for each in found] == ["waypoint", "land"]


def test_a_landing_is_the_end_of_a_plan():
    down = item(21, place=(47.3970, 8.5450, 0))
    assert plan_in(plan(item(16, place=HERE), down))["items"][-1]["type"] == "land"
    with pytest.raises(WireError, match="nothing may follow land"):
        plan_in(plan(down, item(16, place=HERE)))


def test_a_survey_is_flown_by_the_items_that_it_comes_to():
    inner = {"Items": [item(16, place=HERE)]}
    survey = {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": inner}
    assert [each["type"] for each in plan_in(plan(survey))["items"]] == ["waypoint"]


def test_altitudes_above_the_sea_stay_so():
    assert plan_in(plan(item(16, place=HERE, frame=0)))["altitude_reference"] == "amsl"


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"{", "is no JSON"),
        (b"[]", "is no JSON"),
        (b"{}", "must be aerial.mission.v1"),
        (plan(), "an array of 1 to"),
        (plan(item(20)), "at least one item must have a place"),
        (plan(item(16, place=HERE, frame=10)), "MAV_FRAME 10 is not flown here"),
        (plan(item(16, place=HERE), item(16, place=HERE, frame=0)), "are mixed"),
        (plan(item(183, place=HERE)), "MAV_CMD 183 is not flown here"),
        (plan(item(16, place=HERE), item(20), item(16, place=HERE)), "nothing may follow"),
        (plan(item(16, place=HERE), geoFence={"polygons": [{}]}), "its geoFence is not flown here"),
        (plan(item(16, place=HERE), geoFence=[1]), "is no plan of QGroundControl"),
        (plan({"type": "ComplexItem"}), "is no plan of QGroundControl"),
        (plan({"type": "SimpleItem"}), "is no plan of QGroundControl"),
        (plan(item(16, place=("x", 8.5, 8))), "must be"),
    ],
)
def test_what_would_be_flown_otherwise_than_planned_is_refused(data, why):
    with pytest.raises(WireError) as caught:
        plan_in(data)
    assert why in str(caught.value) or why == "must be"


@given(JSON)
def test_whatever_a_file_says_it_is_read_or_refused(content):
    for document in (
        content,
        {"fileType": "Plan", "mission": content},
        {"fileType": "Plan", "mission": {"items": content}},
    ):
        try:
            plan_in(json.dumps(document).encode())
        except WireError:
            continue


@pytest.mark.parametrize(
    ("firmware", "vehicle", "kinds"),
    [
        (12, 2, ("px4", "multirotor")),
        (3, 14, ("ardupilot", "multirotor")),
        (3, 1, ("ardupilot", "plane")),
        (0, 20, ("vtol",)),
        (0, 0, ()),
        (5, 99, ("autopilot 5", "vehicle of type 99")),
    ],
)
def test_what_a_plan_was_made_for_is_kept_beside_what_is_flown(firmware, vehicle, kinds):
    document = json.loads(plan(item(16, place=HERE)))
    document["mission"] |= {"firmwareType": firmware, "vehicleType": vehicle}
    found = plan_in(json.dumps(document).encode())
    assert made_for(found) == kinds
    assert items_of(found) == plan_in(plan(item(16, place=HERE)))


def test_a_robot_flies_plans_of_its_own_kind_and_one_that_does_not_say_any_that_is_known():
    copter = plans_taken({"px4", "multirotor"})
    assert plan_needs({MADE_FOR: ["px4", "multirotor"]}) <= copter
    assert plan_needs({}) <= copter
    missing = plan_needs({MADE_FOR: ["ardupilot", "plane"]}) - copter
    assert missing_text({*missing, "land"}) == "has no land and flies no plan made for ardupilot, plane"
    assert plan_needs({MADE_FOR: ["ardupilot", "plane"]}) <= plans_taken(())
    assert not plan_needs({MADE_FOR: ["autopilot 5"]}) <= plans_taken(())
