"""Plans of QGroundControl: what is flown is what was planned, or the file is refused."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.missions.plan import plan_in

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
