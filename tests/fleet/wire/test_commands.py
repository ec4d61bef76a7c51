import json

import pytest
from cyberwave.data.header import HeaderTemplate
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import Vector3, Velocity
from fleet.wire.commands import MotionDefaults, decode_command, decode_motion
from fleet.wire.envelope import BadCommand
from fleet.wire.verbs import VERBS

DEFAULTS = MotionDefaults(forward=0.5, lateral=0.4, vertical=0.3, yaw_rate=0.8)


def decode(message, **more):
    return decode_command(
        json.dumps(message).encode(), transport=Transport.CLOUD, defaults=lambda _: DEFAULTS, **more
    )


def motion(command, data):
    setpoint = decode({"source_type": "tele", "command": command, "data": data})
    assert isinstance(setpoint, Setpoint)
    linear = setpoint.velocity.linear
    return (linear.x, linear.y, linear.z, setpoint.velocity.yaw_rate)


# -- the envelope -------------------------------------------------------------------------------------


def test_an_sdk_message_is_read_whole():
    command = decode(
        {
            "source_type": "tele",
            "command": "takeoff",
            "data": {"altitude": 2},
            "timestamp": 1760000000.25,
            "session_id": "python-sdk_live_1f",
        },
        request_id="c0ffee",
    )
    origin = Origin(Transport.CLOUD, "tele", "python-sdk_live_1f")
    assert command == Command("takeoff", {"altitude": 2}, origin, command.id, 1760000000.25)
    assert command.id


@pytest.mark.parametrize("name", ["start_video", "stop_video"])
def test_who_asks_for_video_in_the_cloud_without_a_source_type_is_an_operator(name):
    published = decode({"type": name, "timestamp": 5.0, "recording": False})
    assert (published.name, published.origin.source_type, published.data) == (
        name,
        "tele",
        {"recording": False},
    )
    assert decode({"command": name, "source_type": "edit", "data": {"x": 1}}).origin.source_type == "edit"
    assert decode({"command": "land"}).origin.source_type is None
    local = decode_command(
        json.dumps({"command": name}).encode(), transport=Transport.BUS, defaults=lambda _: DEFAULTS
    )
    assert local.origin.source_type is None


def test_an_older_sender_calls_the_command_type():
    assert decode({"type": "start_video"}).name == "start_video"
    assert decode({"type": "x", "command": "land"}).name == "land"


@pytest.mark.parametrize("message", [{"command": "land"}, {"command": "land", "data": None}])
def test_missing_data_is_empty(message):
    assert decode(message).data == {}


@pytest.mark.parametrize("source_type", ["tele", "sim_tele", "robot", "preview"])
def test_the_source_type_is_passed_on_as_it_was_sent(source_type):
    assert decode({"command": "land", "source_type": source_type}).origin.source_type == source_type


def test_a_missing_source_type_is_none_and_not_a_guess():
    assert decode({"command": "land"}).origin.source_type is None


def test_a_message_with_a_status_is_a_reply_and_no_command():
    assert decode({"command": "takeoff", "status": "ok"}) is None
    assert decode({"status": "error", "command": "takeoff", "reason": "no"}) is None


@pytest.mark.parametrize(
    ("given_stamp", "stamp"),
    [
        ({"timestamp": 1760000000}, 1760000000.0),
        ({"ts": 1760000000.5}, 1760000000.5),
        ({"timestamp": 1760000000500}, 1760000000.5),
        ({"timestamp": 1e11}, 1e11),
        ({"timestamp": None, "ts": 3}, 3.0),
        ({}, None),
    ],
)
def test_the_stamp_is_seconds_whatever_the_sender_counts(given_stamp, stamp):
    assert decode({"command": "land", **given_stamp}).stamp == stamp


def test_a_repeat_of_a_stamped_message_has_the_same_id():
    first = decode({"command": "takeoff", "timestamp": 5})
    assert first.id
    assert first.id == decode({"command": "takeoff", "timestamp": 5}).id
    assert first.id != decode({"command": "takeoff", "timestamp": 6}).id


def test_an_unstamped_message_without_a_request_id_cannot_be_distinguished_from_a_second_press():
    assert decode({"command": "takeoff"}).id == ""
    assert decode({"command": "takeoff"}, request_id="r1").id


def test_a_request_is_a_repeat_when_its_id_and_what_it_asks_are_the_same():
    def requested(command, data, request_id="1", stamp=5):
        message = {"command": command, "data": data, "timestamp": stamp}
        return decode(message, request_id=request_id).id

    first = requested("takeoff", {"altitude": 2})
    assert first == requested("takeoff", {"altitude": 2}, stamp=6), "the asker tries again"
    others = (
        requested("land", {}),
        requested("takeoff", {"altitude": 3}),
        requested("takeoff", {"altitude": 2}, "2"),
    )
    assert len({first, *others}) == 4


@pytest.mark.parametrize(
    ("message", "where", "command"),
    [
        ({"data": {}}, "command", ""),
        ({"command": 5}, "command", ""),
        ({"command": ""}, "command", ""),
        ({"command": "land\nFAKE LOG LINE"}, "command", ""),
        ({"command": "a" * 65}, "command", ""),
        ({"command": "land", "data": [1]}, "data", "land"),
        ({"command": "land", "data": "now"}, "data", "land"),
        ({"command": "land", "timestamp": "now"}, "timestamp", "land"),
        ({"command": "land", "source_type": 5}, "source_type", "land"),
        ({"command": "land", "session_id": {}}, "session_id", "land"),
    ],
)
def test_a_malformed_envelope_is_refused_with_the_place_and_the_command(message, where, command):
    with pytest.raises(BadCommand) as refusal:
        decode(message)
    assert (refusal.value.where, refusal.value.command) == (where, command)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).count(f"{where}: ") == 1


# -- stops --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["stop", "emergency_stop", "hover", "brake"])
@pytest.mark.parametrize("flaw", [{"timestamp": "now"}, {"data": "x"}, {"source_type": 5}, {"session_id": 1}])
def test_a_stop_is_never_refused_for_its_trimmings(word, flaw):
    command = decode({"command": word, **flaw})
    assert (command.name, command.data) == (word, {})


@pytest.mark.parametrize("data", [{"activate": True}, {}, {"activate": None}, {"activate": "false"}, "x"])
def test_the_emergency_switch_stops_unless_it_says_false(data):
    assert decode({"command": "estop", "data": data, "timestamp": "now"}).name == "emergency_stop"


def test_only_a_literal_false_releases_the_emergency_stop():
    assert decode({"type": "estop", "data": {"activate": False}}).name == "release_emergency_stop"
    with pytest.raises(BadCommand):
        decode({"command": "estop", "data": {"activate": False}, "timestamp": "now"})


# -- verbs: the word decides the direction ------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "data", "expected"),
    [
        # as the SDK sends them
        ("move_forward", {"linear_x": 0.3, "angular_z": 0}, (0.3, 0, 0, 0)),
        ("move_backward", {"linear_x": -0.3, "angular_z": 0}, (-0.3, 0, 0, 0)),
        ("turn_left", {"linear_x": 0, "angular_z": 0.5}, (0, 0, 0, 0.5)),
        ("turn_right", {"linear_x": 0, "angular_z": 0.5}, (0, 0, 0, -0.5)),
        ("turn_left", {"angular_z": 0}, (0, 0, 0, 0)),
        # as the reference table signs them
        ("turn_right", {"angular_z": -0.5}, (0, 0, 0, -0.5)),
        ("strafe_left", {"linear_y": -0.2}, (0, 0.2, 0, 0)),
        ("strafe_right", {"linear_y": 0.2}, (0, -0.2, 0, 0)),
        ("ascend", {"linear_z": 0.6}, (0, 0, 0.6, 0)),
        ("descend", {"linear_z": -0.6}, (0, 0, -0.6, 0)),
        # as the third party's text has them
        ("strafe_left", {"linear_x": 1.0}, (0, 1.0, 0, 0)),
        ("ascend", {"linear_x": 1.0}, (0, 0, 1.0, 0)),
        # its own field goes before a distance
        ("ascend", {"linear_z": 0.6, "distance": 2}, (0, 0, 0.6, 0)),
        # nothing given
        ("move_forward", {}, (0.5, 0, 0, 0)),
        ("move_backward", {}, (-0.5, 0, 0, 0)),
        ("strafe_left", {}, (0, 0.4, 0, 0)),
        ("strafe_right", {}, (0, -0.4, 0, 0)),
        ("ascend", {}, (0, 0, 0.3, 0)),
        ("descend", {}, (0, 0, -0.3, 0)),
        ("turn_left", {}, (0, 0, 0, 0.8)),
        ("turn_right", {}, (0, 0, 0, -0.8)),
    ],
)
def test_the_verb_fixes_axis_and_sign(command, data, expected):
    assert motion(command, data) == expected


@given(st.sampled_from(sorted(VERBS)), st.floats(-10, 10), st.booleans())
def test_no_number_can_turn_a_verb_round(command, value, own):
    verb = VERBS[command]
    moved = motion(command, {verb.own_field if own else "linear_x": value})
    assert sum(axis != 0 for axis in moved) == (value != 0)
    assert sum(moved) == verb.sign * abs(value)


@pytest.mark.parametrize("command", ["ascend", "descend"])
@pytest.mark.parametrize("distance", [2, -2.0])
def test_a_distance_is_a_displacement_and_not_a_speed(command, distance):
    requested = decode({"command": command, "data": {"distance": distance}})
    assert (requested.name, requested.data) == (command, {"distance": 2.0})
    assert isinstance(requested, Command)


@pytest.mark.parametrize("wrong", ["0.3", True, None, [0.3], {}])
@pytest.mark.parametrize("field", ["linear_x", "linear_y", "linear_z", "angular_z", "distance"])
@pytest.mark.parametrize("command", ["move_forward", "turn_right", "ascend"])
def test_a_magnitude_that_is_no_number_is_refused_and_never_a_default(command, field, wrong):
    with pytest.raises(BadCommand) as refusal:
        motion(command, {field: wrong})
    assert (refusal.value.command, refusal.value.where) == (command, f"data.{field}")
    unit = {"distance": "m", "angular_z": "rad/s"}.get(field, "m/s")
    assert str(refusal.value).endswith(f"; its unit is {unit}")


@pytest.mark.parametrize("word", [b"NaN", b"Infinity", b"-Infinity", b"1e999"])
def test_a_speed_that_is_not_finite_is_refused(word):
    payload = b'{"command": "move", "data": {"linear_x": ' + word + b"}}"
    with pytest.raises(BadCommand):
        decode_command(payload, transport=Transport.CLOUD, defaults=lambda _: DEFAULTS)


# -- signed fields ------------------------------------------------------------------------------------


def test_move_is_signed_on_every_axis():
    assert motion("move", {"linear_x": -0.1, "linear_y": 0.2, "linear_z": -0.3, "angular_z": -0.4}) == (
        -0.1,
        0.2,
        -0.3,
        -0.4,
    )


def test_a_move_of_zero_is_a_setpoint_of_zero():
    setpoint = decode({"command": "move", "data": {"linear_x": 0, "angular_z": 0.0}})
    assert setpoint.velocity.is_zero
    assert setpoint.lease is None


@pytest.mark.parametrize("data", [{}, {"speed": 1}])
def test_a_move_that_names_no_axis_is_refused(data):
    with pytest.raises(BadCommand, match="needs one of linear_x"):
        decode({"command": "move", "data": data})


@pytest.mark.parametrize(
    ("command", "field"), [("set_linear_velocity", "linear"), ("set_angular_velocity", "angular")]
)
def test_a_velocity_that_is_set_is_a_magnitude_to_store_and_no_motion(command, field):
    requested = decode({"command": command, "data": {field: -0.4}})
    assert isinstance(requested, Command)
    assert (requested.name, requested.data) == (command, {field: 0.4})
    for data, why in (({}, "is missing"), ({"linaer": 1}, "not a field"), ({field: "1"}, "a number")):
        with pytest.raises(BadCommand, match=why):
            decode({"command": command, "data": data})


# -- velocity contracts -------------------------------------------------------------------------------

LOCOMOTION = {
    "contract": "locomotion.velocity_command.v1",
    "linear_x": 0.3,
    "linear_y": -0.1,
    "angular_z": -0.2,
    "duration_ms": 500,
    "gait": "walk",
    "origin": "teleop",
}
AERIAL = {
    "contract": "aerial.velocity_command.v1",
    "linear_x": 1,
    "linear_z": -0.5,
    "angular_z": 0.0,
    "duration_ms": 1000,
    "origin": "ai_policy",
}


def velocity(body, command="velocity_command"):
    return decode({"command": command, "source_type": "tele", "velocity_command": body})


@pytest.mark.parametrize("command", ["velocity_command", "locomotion_velocity"])
def test_a_locomotion_velocity_stands_beside_the_data_and_is_signed(command):
    setpoint = velocity(LOCOMOTION, command)
    assert setpoint.velocity == Velocity(Vector3(0.3, -0.1, 0), -0.2, "walk")
    assert setpoint.lease == 0.5


def test_an_aerial_velocity_has_a_vertical_part():
    setpoint = velocity(AERIAL)
    assert setpoint.velocity == Velocity(Vector3(1, 0, -0.5), 0)
    assert setpoint.lease == 1.0


@pytest.mark.parametrize("change", [{"duration_ms": 0}, {"gait": "stand"}])
def test_a_duration_of_zero_or_standing_is_a_stop(change):
    requested = velocity({**LOCOMOTION, **change})
    assert isinstance(requested, Command)
    assert (requested.name, requested.data) == ("stop", {})


def test_what_the_contract_does_not_allow_is_refused_with_its_place():
    with pytest.raises(BadCommand) as refusal:
        velocity({**LOCOMOTION, "linear_x": "0.3"})
    assert (refusal.value.where, refusal.value.command) == ("velocity_command.linear_x", "velocity_command")


def test_a_body_inside_data_is_read_by_the_same_contract():
    assert decode({"command": "velocity_command", "data": AERIAL}).lease == 1.0
    with pytest.raises(BadCommand, match=r"data\.contract"):
        decode({"command": "velocity_command", "data": {"linear_x": 1.0}})


# -- twists -------------------------------------------------------------------------------------------


def twist(message, transport=Transport.CLOUD):
    return decode_motion(json.dumps(message).encode(), transport=transport)


def test_a_twist_is_signed_and_a_missing_axis_is_still():
    setpoint = twist(
        {
            "source_type": "tele",
            "linear": {"x": -0.3, "y": 0.1, "z": 0.2},
            "angular": {"x": 0.0, "z": -0.4},
            "controller_policy_uuid": "p",
            "timestamp": 7,
        }
    )
    assert setpoint.velocity == Velocity(Vector3(-0.3, 0.1, 0.2), -0.4)
    assert (setpoint.stamp, setpoint.origin.source_type) == (7.0, "tele")
    assert twist({"linear": {"x": 1}}).velocity == Velocity(Vector3(1))


def test_a_local_velocity_of_the_bus_is_flat():
    setpoint = twist({"linear_x": 0.2, "linear_y": 0, "angular_x": 0, "angular_z": -1}, Transport.BUS)
    assert setpoint.velocity == Velocity(Vector3(0.2), -1)
    assert setpoint.origin == Origin(Transport.BUS)


def test_a_setpoint_that_the_sdk_puts_on_the_bus_is_read_behind_its_header():
    sample = HeaderTemplate("application/json").pack(b'{"linear_x": 0.2, "angular_z": 0.1}')
    assert decode_motion(sample, transport=Transport.BUS).velocity == Velocity(Vector3(0.2), 0.1)
    with pytest.raises(BadCommand):
        decode_motion(sample, transport=Transport.CLOUD)


@pytest.mark.parametrize(
    ("header", "message", "stamp"),
    [(7.0, {}, 7.0), (7.0, {"ts": 9.0}, 9.0), (7.0, {"timestamp": None}, 7.0), (0.0, {}, None)],
)
def test_a_setpoint_of_the_bus_is_as_old_as_it_says_else_as_its_header_says(header, message, stamp):
    payload = json.dumps({"linear_x": 0.2} | message).encode()
    sample = HeaderTemplate("application/json").pack(payload, ts=header)
    assert decode_motion(sample, transport=Transport.BUS).stamp == stamp


@pytest.mark.parametrize("header", [float("nan"), float("inf")])
def test_a_setpoint_whose_header_is_of_no_time_is_refused(header):
    sample = HeaderTemplate("application/json").pack(b'{"linear_x": 0.2}', ts=header)
    with pytest.raises(BadCommand, match="timestamp: a finite number is needed"):
        decode_motion(sample, transport=Transport.BUS)


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"linear": [1, 2, 3]},
        {"linear": {"x": "1"}},
        {"linear": {}, "angular": {"x": True}},
        {"linear_x": None},
    ],
)
def test_a_twist_that_is_no_twist_is_refused(message):
    with pytest.raises(BadCommand) as refusal:
        twist(message)
    assert refusal.value.command == "motion"


# -- hostile input ------------------------------------------------------------------------------------

REAL = [
    {
        "source_type": "tele",
        "command": "move_forward",
        "data": {"linear_x": 0.3, "angular_z": 0},
        "timestamp": 1,
    },
    {"source_type": "tele", "command": "velocity_command", "velocity_command": LOCOMOTION, "timestamp": 1e12},
    {"source_type": "tele", "command": "estop", "data": {"activate": False}, "session_id": "s"},
    {"type": "ascend", "data": {"distance": 2}},
    {"linear": {"x": 1, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 1}},
]


def numbers_of(requested):
    if not isinstance(requested, Setpoint):
        return []
    linear = requested.velocity.linear
    return [linear.x, linear.y, linear.z, requested.velocity.yaw_rate]


def test_no_hostile_bytes_raise_anything_but_a_refusal_or_move_by_a_number_that_is_none(hostile):
    read = 0
    for payload in hostile(json.dumps(message).encode() for message in REAL):
        for decoder in (
            lambda raw: decode_command(raw, transport=Transport.CLOUD, defaults=lambda _: DEFAULTS),
            lambda raw: decode_motion(raw, transport=Transport.CLOUD),
        ):
            try:
                values = numbers_of(decoder(payload))
            except WireError:
                continue
            read += 1
            assert all(type(value) in (int, float) and value - value == 0 for value in values)
    assert read > 400


@given(st.binary(max_size=100))
def test_arbitrary_bytes_are_refused_by_name(payload):
    with pytest.raises(BadCommand):
        decode_command(payload, transport=Transport.BUS, defaults=lambda _: DEFAULTS)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
MESSAGES = st.fixed_dictionaries(
    {},
    optional={
        "command": st.sampled_from([*VERBS, "move", "velocity_command", "estop", "stop", "takeoff"]) | JSON,
        "type": JSON,
        "data": st.dictionaries(
            st.sampled_from(["linear_x", "linear_y", "angular_z", "distance", "activate"]), JSON
        )
        | JSON,
        "velocity_command": st.fixed_dictionaries(
            {name: st.just(value) | JSON for name, value in AERIAL.items()}
        ),
        "timestamp": JSON,
        "source_type": JSON,
        "linear": JSON,
    },
)


@given(MESSAGES)
def test_any_json_of_the_right_shape_is_read_or_refused(message):
    for decoder in (decode, twist):
        try:
            requested = decoder(message)
        except BadCommand:
            continue
        assert requested is None or isinstance(requested, Command | Setpoint)


# -- the usual form, read in one go ----------------------------------------------------------------------

SCALARS = st.none() | st.booleans() | st.floats() | st.integers() | st.sampled_from([2**63 - 1, 2**63, "1:0"])
USUAL = st.fixed_dictionaries(
    {
        "command": st.sampled_from([*VERBS, "move", "stop", "estop", "takeoff", "a b", "land\n", "", None]),
        "source_type": st.sampled_from(["tele", "sim_tele", "é", "", 7]),
        "timestamp": st.floats() | st.integers() | st.sampled_from([1.7e9, 1.7e12, -1, 2**64, "5", None]),
        "data": st.dictionaries(st.sampled_from(["linear_x", "angular_z", "distance", "activate"]), SCALARS),
    },
    optional={"session_id": st.sampled_from(["me", "a:b", None]), "status": st.just("ok"), "x": SCALARS},
)


def outcome(payload):
    """Return what a message is read as, or how it is refused."""
    try:
        return decode_command(payload, transport=Transport.CLOUD, defaults=lambda _: DEFAULTS)
    except BadCommand as error:
        return str(error), error.command


@settings(max_examples=300)
@given(USUAL, st.sampled_from([b"", b'"command": "stop", ', b'"data": {"linear_x": 1}, ']))
def test_a_message_is_read_alike_in_one_go_and_step_by_step(message, doubled):
    payload = b"{" + doubled + json.dumps(message).encode()[1:]
    quick = outcome(payload)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fleet.wire.commands._usual", lambda *_: None)
        assert quick == outcome(payload)


def test_what_people_send_is_read_in_one_go(monkeypatch):
    monkeypatch.setattr("fleet.wire.commands.parse_object", None)
    sent = {"command": "move", "source_type": "tele", "data": {"linear_x": 0.5}, "timestamp": 1760000000.25}
    assert decode(sent) == decode(sent | {"session_id": ""})
    assert decode(sent).velocity == Velocity(Vector3(0.5))
