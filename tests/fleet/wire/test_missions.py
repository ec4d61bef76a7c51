"""Missions on the wire: read as the published contract has them, holes refused with their place."""

import copy
import json

import pytest
from cyberwave_contracts.models import AerialMissionV1

from fleet.errors import WireError
from fleet.model.command import Transport
from fleet.model.navigation import ActionState, Control
from fleet.model.report import NavigationReport
from fleet.wire.missions import decode_mission
from fleet.wire.reports import sender, to_mqtt

MISSION = {
    "contract": "aerial.mission.v1",
    "name": "north field",
    "home": {"latitude": 47.0, "longitude": 8.0, "altitude_amsl_m": 400.0},
    "default_altitude_m": 20,
    "cruise_speed_ms": 4.0,
    "items": [
        {"type": "waypoint", "latitude": 47.001, "longitude": 8.0, "acceptance_radius_m": 2},
        {"type": "loiter_time", "latitude": 47.001, "longitude": 8.001, "altitude_m": 30.0, "seconds": 5},
        {"type": "loiter_turns", "latitude": 47.0, "longitude": 8.0, "turns": 2, "direction": "ccw"},
        {"type": "return_to_launch"},
    ],
}


def read(mission=None, **message):
    """Return what a mission message asks."""
    body = {"command": "start", "mission_execution_uuid": "e1", "source_type": "tele", **message}
    if mission is not None:
        body["mission"] = mission
    return decode_mission(json.dumps(body).encode(), transport=Transport.CLOUD)


def changed(where, value):
    """Return the mission with one member changed, or taken away by None."""
    mission = copy.deepcopy(MISSION)
    *parents, last = where.split(".")
    target = mission
    for step in parents:
        target = target[int(step) if step.isdigit() else step]
    if value is None:
        del target[int(last) if last.isdigit() else last]
    else:
        target[int(last) if last.isdigit() else last] = value
    return mission


def test_a_mission_of_the_contract_is_read_whole():
    AerialMissionV1.model_validate(MISSION)
    requested = read(MISSION)
    assert (requested.action_id, requested.instruction.name, requested.instruction.above_sea) == (
        "e1",
        "north field",
        False,
    )
    kinds = [item.kind for item in requested.instruction.items]
    assert kinds == ["waypoint", "loiter_time", "loiter_turns", "return_to_launch"]
    assert [item.point.altitude for item in requested.instruction.items[:3]] == [20.0, 30.0, 20.0]
    assert requested.instruction.items[0].tolerance == 2.0
    assert (requested.instruction.items[2].turns, requested.instruction.items[2].clockwise) == (2, False)
    assert requested.instruction.constraints.max_speed == 4.0


def test_steps_are_the_items_of_a_mission():
    place = {"latitude": 47.0, "longitude": 8.0, "altitude_m": 10}
    requested = read(steps=[{"type": "waypoint", "params": place}, {"type": "return_to_launch"}])
    assert [item.kind for item in requested.instruction.items] == ["waypoint", "return_to_launch"]
    assert requested.instruction.home is None


@pytest.mark.parametrize(
    ("command", "control"),
    [("cancel", Control.STOP), ("pause", Control.PAUSE), ("resume", Control.RESUME)],
)
def test_controls_are_those_of_the_running_action(command, control):
    assert read(command=command).instruction is control


def test_a_cancel_is_read_however_broken_the_rest_of_it_is():
    assert read(command="cancel", mission_execution_uuid=7, timestamp="soon").instruction is Control.STOP


@pytest.mark.parametrize(
    ("where", "value", "expected"),
    [
        ("items.0.latitude", None, "mission.items.0.latitude"),
        ("items.1.seconds", None, "mission.items.1.seconds"),
        ("items.2.turns", 256, "mission.items.2.turns"),
        ("items.0.latitude", 90.5, "mission.items.0.latitude"),
        ("items.0.longitude", "8", "mission.items.0.longitude"),
        ("items.0.speed_ms", 0, "mission.items.0.speed_ms"),
        ("items.1", {"type": "return_to_launch"}, "mission.items.2"),
        ("items.0", "north", "mission.items.0"),
        ("items.0.type", "dance", "mission.items.0.type"),
        ("items", [{"type": "return_to_launch"}], "mission.items"),
        ("items", [], "mission.items"),
        ("default_altitude_m", None, "mission.items.0.altitude_m"),
        ("altitude_reference", "terrain", "mission.altitude_reference"),
        ("contract", "aerial.mission.v2", "mission.contract"),
        ("home.altitude_amsl_m", None, "mission.home.altitude_amsl_m"),
    ],
)
def test_a_hole_is_refused_with_its_place_and_the_missions_id(where, value, expected):
    with pytest.raises(WireError) as refusal:
        read(changed(where, value))
    assert refusal.value.where == expected
    assert refusal.value.action_id == "e1"


def test_a_mission_without_an_id_or_with_an_unknown_command_is_refused():
    with pytest.raises(WireError, match="mission_execution_uuid"):
        read(MISSION, mission_execution_uuid="")
    with pytest.raises(WireError, match="launch"):
        read(MISSION, command="launch")


@pytest.mark.parametrize(
    ("state", "status"), [(ActionState.BLOCKED, "running"), (ActionState.COMPLETED, "completed")]
)
def test_the_status_of_a_mission_goes_to_its_own_topic(state, status):
    report = NavigationReport(5.0, "e1", state, 50.0, "item 3 of 4", step=2)
    ((suffix, payload),) = to_mqtt(report, sender(source_type="edge", session=""))
    assert suffix == "mission/status"
    assert json.loads(payload) == {
        "mission_execution_uuid": "e1",
        "status": status,
        "current_step": 2,
        "message": "item 3 of 4",
        "source_type": "edge",
        "timestamp": 5.0,
    }
