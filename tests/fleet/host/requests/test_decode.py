import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.host.requests.decode import LARGEST, RequestDecoder, is_discrete, max_wait
from fleet.host.safety.verb_speeds import VERB_SPEED, VerbSpeeds
from fleet.model.command import Command, Setpoint, Transport
from fleet.model.geometry import Vector3, Velocity
from fleet.model.navigation import GoTo, Navigate
from fleet.robot_config import AdapterConfig, Limits, WorldOrigin
from tests.tools.garbage import leaves_nothing

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


def decoder(limits=None, home_altitude=None, **config):
    return RequestDecoder(
        AdapterConfig(name="rex", twin=TWIN, **config),
        VerbSpeeds(limits or Limits()).of,
        planar=config.pop("planar", False),
        home_altitude=lambda: home_altitude,
    )


def decode(kind, message, **made):
    return decoder(**made).decode(
        kind, json.dumps(message).encode(), transport=Transport.CLOUD, request_id="q1"
    )


def test_each_kind_of_message_has_its_own_meaning():
    takeoff = decode("command", {"command": "takeoff"})
    assert takeoff == Command("takeoff", {}, takeoff.origin, takeoff.id)
    assert isinstance(decode("motion", {"linear": {"x": 1.0}}), Setpoint)
    goal = decode("navigate", {"command": "goto", "position": [1, 2, 3]})
    assert isinstance(goal, Navigate)
    assert goal.instruction.goal.position == Vector3(1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("kind", "message", "once"),
    [
        ("command", {"command": "ascend", "data": {"distance": 1.5}}, True),
        ("command", {"command": "takeoff"}, True),
        ("navigate", {"command": "goto", "position": [1, 2, 3]}, True),
        ("command", {"command": "ascend", "data": {"linear_z": 0.5}}, False),
        ("motion", {"linear": {"x": 1.0}}, False),
        ("joints", {"target_positions": {"hip": 1.0}}, False),
    ],
)
def test_a_verb_with_a_distance_is_asked_once_and_a_setpoint_is_one_of_a_stream(kind, message, once):
    assert is_discrete(decode(kind, message)) is once


def test_the_way_in_is_remembered():
    message = b'{"command": "takeoff", "source_type": "tele", "session_id": "anna"}'
    origin = decoder().decode("command", message, transport=Transport.BUS).origin
    assert (origin.transport, origin.source_type, origin.session) == (Transport.BUS, "tele", "anna")


def test_a_verb_without_a_speed_is_slow():
    assert decode("command", {"command": "move_forward"}).velocity == Velocity(Vector3(x=VERB_SPEED))


@pytest.mark.parametrize(
    ("verb", "axis", "value"),
    [("move_backward", "x", -0.2), ("strafe_left", "y", 0.2), ("descend", "z", -0.1)],
)
def test_a_verb_without_a_speed_stays_within_the_robot_s_limits(verb, axis, value):
    limits = Limits(speed=0.2, vertical_speed=0.1, yaw_rate=0.3)
    assert decode("command", {"command": verb}, limits=limits).velocity == Velocity(Vector3(**{axis: value}))
    turn = decode("command", {"command": "turn_right"}, limits=limits)
    assert turn.velocity == Velocity(yaw_rate=-0.3)


def test_list_rotations_are_read_in_the_robot_s_order():
    goal = {"command": "goto", "position": [0, 0, 0], "rotation": [0, 0, 0, 1]}
    assert decode("navigate", goal, rotation_order="xyzw").instruction.goal.yaw == pytest.approx(0.0)
    assert abs(decode("navigate", goal, rotation_order="wxyz").instruction.goal.yaw) == pytest.approx(
        3.14159265
    )


def test_geodetic_altitudes_count_from_home_else_from_the_origin():
    goal = {"command": "goto", "geodetic_position": {"latitude": 1.0, "longitude": 2.0, "altitude": 10.0}}
    origin = WorldOrigin(latitude=1.0, longitude=2.0, altitude=100.0)
    at_home = decode("navigate", goal, origin=origin, home_altitude=30.0).instruction
    assert isinstance(at_home, GoTo)
    assert at_home.goal.geo.altitude == 40.0
    assert decode("navigate", goal, origin=origin).instruction.goal.geo.altitude == 110.0


@pytest.mark.parametrize("kind", ["command", "navigate"])
def test_a_reply_asks_nothing(kind):
    assert decode(kind, {"status": "ok", "command": "takeoff"}) is None


@given(st.sampled_from(["command", "navigate", "motion"]), st.binary(max_size=80))
def test_no_bytes_do_anything_but_ask_or_be_refused(kind, payload):
    try:
        request = decoder().decode(kind, payload, transport=Transport.CLOUD)
    except WireError:
        return
    assert request is None or isinstance(request, Command | Setpoint | Navigate)


BAD = (
    b"",
    b"{",
    b"[1]",
    b'{"command": 5}',
    b'{"command": "goto"}',
    b"\xff",
    b'{"command": "' + b"x" * 60_000,
)


@pytest.mark.parametrize("kind", ["command", "navigate", "motion", "mission", "joints"])
def test_a_refusal_keeps_no_payload_alive_until_the_garbage_collector_looks(kind, monkeypatch):
    made = decoder()
    monkeypatch.setattr("fleet.host.requests.decode.LARGEST", 50_000)

    def refuse_all():
        for payload in BAD:
            with contextlib.suppress(WireError):
                made.decode(kind, payload, transport=Transport.CLOUD)

    refuse_all()
    assert leaves_nothing(refuse_all)


@pytest.mark.parametrize(("kind", "stop"), [("command", "emergency_stop"), ("navigate", "stop")])
def test_a_message_too_large_to_read_stops_where_stops_come(kind, stop):
    found = decoder().decode(kind, b" " * (LARGEST + 1), transport=Transport.CLOUD)
    assert found.name == stop
    assert found.flaw == f"{LARGEST + 1} bytes are more than the {LARGEST} that are read"


@pytest.mark.parametrize("kind", ["motion", "joints"])
def test_a_message_too_large_to_read_is_refused_where_no_stop_comes(kind):
    with pytest.raises(WireError, match="bytes are more than"):
        decoder().decode(kind, b" " * (LARGEST + 1), transport=Transport.CLOUD)
    with pytest.raises(WireError, match="it came compressed"):
        decoder().decode(kind, b"{}", transport=Transport.CLOUD, unread="it came compressed")


def test_an_error_of_the_edges_own_takes_no_stop_away(caplog):
    broken = decoder()
    broken._decoders["command"] = lambda *_, **__: 1 / 0
    stop = broken.decode("command", b'{"command": "stop"}', transport=Transport.CLOUD)
    assert (stop.name, stop.flaw) == (
        "stop",
        "it could not be read (ZeroDivisionError); the edge's log says why",
    )
    with pytest.raises(WireError, match="it could not be read"):
        broken.decode("command", b'{"command": "takeoff"}', transport=Transport.CLOUD)
    assert caplog.text.count("a command message could not be read") == 2


@pytest.mark.parametrize(
    ("kind", "message", "seconds"),
    [
        ("command", {"command": "takeoff"}, 7.0),
        ("command", {"command": "stop"}, float("inf")),
        ("motion", {"linear": {"x": 1.0}}, 0.4),
        ("motion", {"linear": {"x": 0.0}}, float("inf")),
        ("joints", {"target_positions": {"hip": 1.0}}, 0.4),
        ("navigate", {"command": "pause"}, float("inf")),
        ("navigate", {"command": "stop"}, float("inf")),
        ("navigate", {"command": "goto", "position": [1, 2, 3]}, 7.0),
    ],
)
def test_what_stops_a_robot_is_never_too_late(kind, message, seconds):
    config = AdapterConfig(name="rex", twin=TWIN, max_age=0.4, command_max_age=7.0)
    assert max_wait(decode(kind, message), config) == seconds
