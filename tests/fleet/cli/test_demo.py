"""The demo says what to try, with a robot that is there."""

import json

import pytest

from fleet.cli.demo import TRIES, _own_broker, _write_examples, demo_file, twin_of
from fleet.config.load import load


class Notes:
    """An output that keeps what it is to say."""

    def __init__(self):
        self.lines = []

    def note(self, line):
        self.lines.append(line)


@pytest.mark.parametrize("one", TRIES, ids=lambda one: one.robot)
def test_what_to_try_is_said_of_the_robot_that_is_there(one):
    notes = Notes()
    _write_examples(notes, "127.0.0.1", 1883, [one])
    text = "\n".join(notes.lines)
    assert f"send {one.robot} {one.command}" in text
    assert f"cyberwave/twin/{twin_of(one.robot)}/command" in text
    assert not any(other.robot in text for other in TRIES if other is not one)


def test_a_demo_of_nothing_is_a_usage_error_and_starts_nothing(fleet):
    result = fleet("demo", "--drones", "0", "--ugvs", "0", "--dogs", "0")
    assert result.code == 2
    assert "ask for one of --drones, --ugvs, --dogs" in result.err


def test_its_broker_takes_any_port_when_the_standard_one_is_taken(monkeypatch, free_port):
    monkeypatch.setattr("fleet.cli.demo.MQTT_PORT", free_port)
    with _own_broker("127.0.0.1") as first, _own_broker("127.0.0.1") as second:
        assert first.port == free_port
        assert second.port not in {0, free_port}


def test_every_robot_of_the_demo_has_a_place_of_its_own():
    file = json.loads(demo_file(2, "127.0.0.1", 1883, ugvs=2, dogs=2))
    assert len(file["site"]["origin"]) == 3
    starts = [tuple(robot["start"]) for robot in file["robots"] if robot["adapter"] != "mavlink"]
    assert len(set(starts)) == 4
    assert all("home=" in robot["link"] for robot in file["robots"] if robot["adapter"] == "mavlink")


def test_every_kind_of_robot_can_be_tried():
    file = demo_file(1, "127.0.0.1", 1883, ugvs=1, dogs=1)
    assert all(f'"{one.robot}"' in file for one in TRIES)


def test_another_edges_robots_are_other_twins_and_are_named_with_their_edge():
    notes = Notes()
    _write_examples(notes, "127.0.0.1", 1883, TRIES[:1], "demo-2")
    text = "\n".join(notes.lines)
    assert "send demo-2/drone-1 takeoff" in text
    assert "goto demo-2/drone-1" in text
    assert f"cyberwave/twin/{twin_of('drone-1', 'demo-2')}/command" in text
    assert twin_of("drone-1", "demo-2") != twin_of("drone-1")
    file = json.loads(demo_file(1, "127.0.0.1", 1883, ugvs=1, dogs=1, edge="demo-2"))
    assert file["edge"]["id"] == "demo-2"
    assert {robot["twin"] for robot in file["robots"]} == {
        twin_of(robot["name"], "demo-2") for robot in file["robots"]
    }


def test_a_second_demo_is_offered_a_free_name(fleet, spawn_edge):
    spawn_edge("demo")
    spawn_edge("demo-2")
    result = fleet("demo")
    assert result.code == 1
    assert "start another demo beside it with --edge-id demo-3" in result.err


@pytest.mark.parametrize(("drones", "ugvs", "dogs"), [(1, 1, 0), (1, 0, 0), (0, 1, 1), (2, 3, 1)])
def test_the_mission_of_the_demo_is_valid_for_the_robots_that_are_there(tmp_path, drones, ugvs, dogs):
    file = tmp_path / "fleet.yaml"
    file.write_text(demo_file(drones, "127.0.0.1", 1883, ugvs=ugvs, dogs=dogs))
    (mission,) = load(file).missions
    assert mission.name == "patrol"
    assert mission.program({}).steps


def test_the_demo_offers_its_mission():
    notes = Notes()
    _write_examples(notes, "127.0.0.1", 1883, TRIES[:1])
    assert any(line.endswith("mission rehearse patrol") for line in notes.lines)
    assert any(line.endswith("mission run patrol") for line in notes.lines)


def test_the_demos_schedule_of_its_mission_is_switched_off(tmp_path):
    path = tmp_path / "fleet.yaml"
    path.write_text(demo_file(1, "127.0.0.1", 1883, ugvs=1))
    config = load(path).config
    assert [(one.mission, one.enabled) for one in config.schedules.values()] == [("patrol", False)]
    assert json.loads(demo_file(0, "127.0.0.1", 1883, dogs=1))["schedules"] == {}
