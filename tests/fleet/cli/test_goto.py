"""Sending a robot, or the robots of a group, to a place."""

import json
import math

import pytest

from fleet.model.command import Reply, ReplyStatus
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement

TAKEN = Reply("goto", ReplyStatus.ACCEPTED)


@pytest.fixture
def yard(play_edge):
    robots = {
        name: {"health": "ok", "site": Vector3(x), "placement": Placement(Vector3(x))}
        for name, x in (("rex", -5.0), ("beast", 5.0))
    }
    robots["beast"]["separation"] = "unknown to dog-1"
    return play_edge("yard-1", robots=robots, groups={"ground": ["rex", "beast"]})


def test_a_group_is_sent_nowhere_without_spacing_and_spread_with_it(fleet, yard):
    requested = {name: yard.answers(name, TAKEN) for name in ("rex", "beast")}
    refused = fleet("goto", "ground", "1", "2", "--site")
    assert (refused.code, "one point for 2 robots" in refused.err) == (5, True)
    assert requested == {"rex": [], "beast": []}
    result = fleet("goto", "ground", "0", "2", "--site", "--spacing", "4")
    assert result.code == 0
    places = {name: json.loads(each[0].payload)["position"] for name, each in requested.items()}
    assert places["rex"][0] - 5.0 < 0.0 < places["beast"][0] + 5.0


def test_that_nobody_knows_how_far_a_robot_is_from_another_is_said(fleet, yard):
    yard.answers("beast", TAKEN)
    assert fleet("goto", "beast", "1", "2").err == "beast: separation unknown to dog-1\n"


def test_two_frames_at_once_are_a_usage_error(fleet, yard):
    assert fleet("goto", "rex", "1", "2", "--geo", "--site").code == 2


def test_a_robot_is_led_through_the_places_of_the_command_line_or_of_a_file(fleet, yard, tmp_path):
    requested = yard.answers("rex", TAKEN)
    (tmp_path / "round.csv").write_text("1,2\n3,4\n")
    assert fleet("goto", "rex", "1,2", "3,4").code == 0
    assert fleet("goto", "rex", "--path", str(tmp_path / "round.csv")).code == 0
    routes = [json.loads(each.payload)["waypoints"] for each in requested]
    assert routes == [[{"position": [1.0, 2.0]}, {"position": [3.0, 4.0]}]] * 2


@pytest.mark.parametrize("arguments", [(), ("1", "2", "--path", "round.csv")])
def test_either_places_or_a_path_are_needed(fleet, yard, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "round.csv").write_text("1,2\n")
    result = fleet("goto", "rex", *arguments)
    assert (result.code, "either places or --path" in result.err) == (2, True)


DOCK = Place("dock-1", (2.0, 3.5), kind="dock", heading=math.pi / 2)
YARD = Place("yard", (0.0, 2.0), radius=3.0, capacity=2)
HIGH = Place("high", (47.0, 8.0, 20.0), frame="geodetic", heading=0.0)


@pytest.fixture
def placed(play_edge):
    robots = {
        name: {"health": "ok", "site": Vector3(x), "placement": Placement(Vector3(x))}
        for name, x in (("rex", -5.0), ("beast", 5.0), ("mule", 9.0))
    }
    groups = {"ground": ["rex", "beast"], "all": ["rex", "beast", "mule"]}
    return play_edge(
        "yard-1", robots=robots, groups=groups, places={each.name: each for each in (DOCK, YARD, HIGH)}
    )


def test_a_robot_is_sent_to_a_place_by_its_name_with_its_heading_and_no_height_that_nobody_said(
    fleet, placed
):
    requested = placed.answers("rex", TAKEN)
    assert fleet("goto", "rex", "dock-1").code == 0
    message = json.loads(requested[0].payload)
    assert message["position"] == pytest.approx([7.0, 3.5])
    assert message["yaw"] == pytest.approx(math.pi / 2)


def test_a_place_on_earth_is_degrees_and_its_heading_one_of_the_compass(fleet, placed):
    requested = placed.answers("rex", TAKEN)
    assert fleet("goto", "rex", "high").code == 0
    message = json.loads(requested[0].payload)
    assert message["geodetic_position"] == pytest.approx(
        {"latitude": 47.0, "longitude": 8.0, "altitude": 20.0}
    )
    assert message["orientation"] == {"heading": 90.0}


def test_a_group_is_spread_in_a_place_that_has_room_for_it(fleet, placed):
    requested = {name: placed.answers(name, TAKEN) for name in ("rex", "beast")}
    assert "one point for 2 robots" in fleet("goto", "ground", "yard").err
    assert "do not fit into yard" in fleet("goto", "ground", "yard", "--spacing", "7").err
    assert requested == {"rex": [], "beast": []}
    assert fleet("goto", "ground", "yard", "--spacing", "4").code == 0
    there = {name: json.loads(each[0].payload)["position"][0] for name, each in requested.items()}
    assert there["rex"] - 5.0 < 0.0 < there["beast"] + 5.0


@pytest.mark.parametrize(
    ("arguments", "code", "expected"),
    [
        (("ground", "dock-1"), 5, "dock-1 has room for 1, these are 2"),
        (("all", "yard", "--spacing", "1"), 5, "yard has room for 2, these are 3"),
        (("rex", "dok-1"), 5, "there is no place 'dok-1'"),
        (("rex", "dock-1", "--geo"), 2, "dock-1 has a frame of its own"),
    ],
)
def test_a_place_that_is_none_or_too_small_moves_nobody(fleet, placed, arguments, code, expected):
    requested = [placed.answers(name, TAKEN) for name in ("rex", "beast", "mule")]
    result = fleet("goto", *arguments)
    assert (result.code, expected in result.err) == (code, True), result.err
    assert requested == [[], [], []]


def test_a_place_that_two_edges_have_differently_moves_nobody(fleet, placed, play_edge):
    moved = Place("dock-1", (9.0, 9.0), kind="dock")
    play_edge("yard-2", robots={"kestrel": {}}, groups={"all": ["kestrel"]}, places={"dock-1": moved})
    result = fleet("goto", "all", "dock-1")
    assert (result.code, "not the same place" in result.err) == (5, True), result.err
