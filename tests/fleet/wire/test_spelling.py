"""Data that nobody reads must not move a robot otherwise than it was asked."""

import copy
import json

import pytest

from fleet.errors import WireError
from fleet.model.command import Transport
from fleet.wire.commands import MotionDefaults, decode_command, decode_motion
from fleet.wire.joints import decode_joints
from fleet.wire.missions import decode_mission
from fleet.wire.navigation import decode_navigate
from fleet.wire.spelling import MOST_FOREIGN, refuse_misspelt, refuse_unknown
from fleet.wire.verbs import VERBS

DEFAULTS = MotionDefaults(0.5, 0.5, 0.5, 0.5)
ENVELOPE = {"command", "source_type", "timestamp", "session_id", "action_id", "id", "frame", "frame_id"}
"""What says who asks and when, or is too short to be told from others; it is judged elsewhere."""


def command(payload):
    return decode_command(payload, transport=Transport.CLOUD, defaults=lambda _: DEFAULTS)


def motion(payload):
    return decode_motion(payload, transport=Transport.BUS)


def navigate(payload):
    return decode_navigate(payload, transport=Transport.CLOUD, rotation_order="auto", home_altitude=400.0)


def joints(payload):
    return decode_joints(payload, transport=Transport.CLOUD)


def mission(payload):
    return decode_mission(payload, transport=Transport.CLOUD)


BODY = {"linear_x": 0.2, "linear_y": 0.1, "angular_z": 0.1, "duration_ms": 500, "gait": "trot"}
CONTRACT = {"contract": "locomotion.velocity_command.v1", "origin": "teleop", **BODY}
WAYPOINT = {"position": {"x": 1, "y": 2, "z": 3}, "rotation": {"w": 1, "x": 0, "y": 0, "z": 0}}
PLAN = {
    "contract": "aerial.mission.v1",
    "name": "round",
    "altitude_reference": "amsl",
    "default_altitude_m": 500,
    "cruise_speed_ms": 2,
    "items": [
        {"type": "waypoint", "latitude": 47, "longitude": 8, "altitude_m": 520, "acceptance_radius_m": 2},
        {"type": "loiter_turns", "latitude": 47, "longitude": 8, "turns": 2, "radius_m": 9, "speed_ms": 3},
    ],
}
MESSAGES = [
    *((command, {"command": verb, "data": {"distance": 0.1}}) for verb in VERBS),
    *((command, {"command": verb, "data": {spec.own_field: 0.1}}) for verb, spec in VERBS.items()),
    (command, {"command": "move", "data": {"linear_x": 0.1, "linear_y": 0.1, "angular_z": 0.2}}),
    (command, {"command": "locomotion_velocity", "velocity_command": CONTRACT}),
    (command, {"command": "takeoff", "data": {"altitude": 3}}),
    (motion, {"linear": {"x": 0.2, "y": 0.1}, "angular": {"z": 0.3}}),
    (motion, {"linear_x": 0.2, "linear_y": 0.1, "angular_z": 0.3}),
    (navigate, {"command": "goto", "position": [1, 2, 3], "yaw": 0.3, "constraints": {"max_speed_ms": 0.3}}),
    (
        navigate,
        {"command": "goto", "position": [1, 2, 3], "rotation": [1, 0, 0, 0], "metadata": {"wait_s": 9}},
    ),
    (navigate, {"command": "path", "waypoints": [WAYPOINT, WAYPOINT], "metadata": {"max_loops": 2}}),
    (
        navigate,
        {
            "command": "goto",
            "geodetic_position": {"latitude": 47, "longitude": 8, "altitude": 3},
            "orientation": {"heading": 90},
        },
    ),
    (navigate, {"command": "relative_move", "relative_translation": [1, 0, 0], "frame": "body"}),
    (joints, {"source_type": "tele", "target_positions": {"_1": 0.5}, "update_mode": "relative"}),
    (mission, {"command": "start", "mission_execution_uuid": "e", "mission": PLAN}),
]


def paths(value, at=()):
    """Yield the path of every field of a message."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, inner in pairs:
        if isinstance(name, str):
            yield (*at, name)
        yield from paths(inner, (*at, name))


def misspelt(message, path):
    """Yield the message with one field misspelt: a letter left out, two swapped, one doubled."""
    name = path[-1]
    middle = len(name) // 2
    slips = {
        name[:middle] + name[middle + 1 :],
        name[: middle - 1] + name[middle] + name[middle - 1] + name[middle + 1 :],
        name[:middle] + name[middle] + name[middle:],
    }
    for slip in slips - {name}:
        changed = copy.deepcopy(message)
        inner = changed
        for step in path[:-1]:
            inner = inner[step]
        inner[slip] = inner.pop(name)
        yield changed


@pytest.mark.parametrize(("decode", "message"), MESSAGES)
def test_a_misspelt_field_is_refused_wherever_it_stands(decode, message):
    decode(json.dumps(message).encode())
    tried = 0
    for path in paths(message):
        if path[-1] in ENVELOPE or path[-1] in {"_1", "w", "x", "y", "z", "altitude", "altitude_m"}:
            continue
        for changed in misspelt(message, path):
            tried += 1
            with pytest.raises(WireError):
                decode(json.dumps(changed).encode())
    assert tried


def test_the_near_miss_is_named_with_its_place():
    with pytest.raises(WireError, match=r"data\.distnce: .*did you mean 'distance'\?"):
        command(b'{"command": "move_forward", "data": {"distnce": 0.1}}')
    with pytest.raises(WireError, match=r"data\.banana: .*it takes angular_z, distance, linear_x"):
        command(b'{"command": "move_forward", "data": {"banana": 0.1}}')
    with pytest.raises(WireError, match=r"constraints\.max_speed: .*'max_speed_ms'"):
        navigate(b'{"command": "goto", "position": [1, 2, 3], "constraints": {"max_speed": 0.1}}')


@pytest.mark.parametrize(
    ("verb", "data"),
    [
        ("move_forward", {"linear_y": 0.2}),
        ("move_forward", {"linear_x": 0.2, "angular_z": 0.3}),
        ("turn_left", {"linear_x": 0.2, "angular_z": 0.3}),
        ("ascend", {"linear_z": 0.2, "linear_x": 0.3}),
    ],
)
def test_a_speed_along_another_axis_than_the_words_is_refused(verb, data):
    with pytest.raises(WireError, match=f"{verb} has only"):
        command(json.dumps({"command": verb, "data": data}).encode())


def test_fields_of_other_programs_are_let_through_as_long_as_they_look_like_none_of_ours():
    message = {"command": "goto", "position": [1, 2, 3], "controller_policy_uuid": "p", "planner": "LIN"}
    assert navigate(json.dumps(message | {"nav_frame_coords": True, "environment_uuid": "e"}).encode())


def test_a_message_of_very_many_unknown_fields_is_refused_before_they_are_compared():
    members = {f"field{number}": 1 for number in range(MOST_FOREIGN + 1)}
    with pytest.raises(WireError, match="more than 64 fields"):
        refuse_misspelt(members, frozenset({"position"}))
    with pytest.raises(WireError, match="field0: "):
        refuse_unknown(members, frozenset({"position"}))


@pytest.mark.parametrize("word", ["stop", "emergency_stop", "hover", "brake"])
def test_a_stop_is_obeyed_whatever_else_it_says(word):
    assert command(json.dumps({"command": word, "dta": {}, "data": {"distnce": 1}}).encode()).name == word
