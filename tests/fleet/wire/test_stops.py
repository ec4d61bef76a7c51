import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.command import Command, Transport
from fleet.model.navigation import Control, Navigate
from fleet.wire.commands import MotionDefaults, decode_command, decode_motion
from fleet.wire.joints import decode_joints
from fleet.wire.missions import decode_mission
from fleet.wire.navigation import decode_navigate
from fleet.wire.stops import STOP_WORDS, is_reply, releases, stop_in, stop_word

DEFAULTS = MotionDefaults(1, 1, 1, 1)
DECODERS = {
    "command": lambda payload: decode_command(payload, transport=Transport.CLOUD, defaults=DEFAULTS),
    "navigate": lambda payload: decode_navigate(payload, transport=Transport.CLOUD, rotation_order="auto"),
    "motion": lambda payload: decode_motion(payload, transport=Transport.CLOUD),
    "joints": lambda payload: decode_joints(payload, transport=Transport.CLOUD),
    "mission": lambda payload: decode_mission(payload, transport=Transport.CLOUD),
}


@pytest.mark.parametrize(
    ("name", "word"),
    [
        *((word, word) for word in sorted(STOP_WORDS)),
        ("STOP", "stop"),
        (" Stop ", "stop"),
        ("estop", "emergency_stop"),
        ("E-Stop", "emergency_stop"),
        ("EmergencyStop", "emergency_stop"),
        ("emergency-stop!", "emergency_stop"),
        ("\uff53\uff54\uff4f\uff50", "stop"),
        ("stop_video", ""),
        ("stopwatch", ""),
        ("start", ""),
        ("", ""),
        ("stop" * 100, ""),
        (None, ""),
        (["stop"], ""),
    ],
)
def test_a_stop_is_known_by_its_name_however_it_is_written(name, word):
    assert stop_word(name) == word


@pytest.mark.parametrize("kind", DECODERS)
@pytest.mark.parametrize("field", ["command", "type"])
@pytest.mark.parametrize("name", ["emergency_stop", "E-Stop", "brake"])
@pytest.mark.parametrize("more", [{}, {"timestamp": "never", "source_type": 7, "session_id": [], "data": 5}])
def test_a_stop_is_one_on_every_topic_whatever_stands_beside_it(kind, field, name, more):
    request = DECODERS[kind](json.dumps({field: name, **more}).encode())
    assert isinstance(request, Command)
    assert request.name == stop_word(name)


@pytest.mark.parametrize("kind", ["navigate", "mission"])
def test_what_only_ends_a_task_stays_a_control(kind):
    request = DECODERS[kind](b'{"command": "Stop"}')
    assert isinstance(request, Navigate)
    assert request.instruction is Control.STOP


def test_a_stop_beside_a_velocity_or_another_command_is_what_counts():
    assert DECODERS["motion"](b'{"linear": {"x": 1}, "command": "stop"}').name == "stop"
    assert DECODERS["joints"](b'{"positions": {"a": 1}, "type": "stop"}').name == "stop"
    assert DECODERS["command"](b'{"command": "takeoff", "type": "emergency_stop"}').name == "emergency_stop"


@pytest.mark.parametrize(
    ("message", "reply"),
    [
        ({"status": "ok", "command": "stop", "source_type": "edge"}, True),
        ({"status": "ok", "command": "stop"}, True),
        ({"status": "error", "command": "takeoff", "source_type": "tele"}, True),
        ({"status": "ok", "command": "stop", "source_type": "tele"}, False),
        ({"status": None, "command": "emergency_stop", "source_type": ["edge"]}, False),
        ({"command": "stop"}, False),
    ],
)
def test_a_status_makes_no_answer_of_a_stop_that_somebody_asks(message, reply):
    assert is_reply(message) == reply


def test_only_a_literal_false_releases():
    assert releases("estop", {"activate": False})
    for data in ({"activate": 0}, {"activate": None}, {}, None, [False], "false"):
        assert not releases("estop", data)


REFUSED = [
    (b"", ""),
    (b"{", ""),
    (b"null", ""),
    (b'{"command": "takeoff"', ""),
    (b'{"command": "stop_video"', ""),
    (b'{"command": "start", "data": {"command": "stop"}, "x": 1}', ""),
    (b'{"command": "stop", "data": {', "stop"),
    (b'{"command": "emergency_stop', "emergency_stop"),
    (b"{'command': 'stop'}", "stop"),
    (b"{command: stop}", "stop"),
    (b"command=stop&x=1", "stop"),
    (b"stop", "stop"),
    (b'"emergency_stop"', "emergency_stop"),
    (b"E-STOP!\n", "emergency_stop"),
    (b'[{"command": "stop"}]', "stop"),
    (b'{"command": "stop", "x": NaN}', "stop"),
    (b'{"command": "stop", "x": 1e999}', "stop"),
    (b'{"command": "takeoff", "command": "stop"}', "stop"),
    (b'{"command": "stop", "command": "takeoff"}', "stop"),
    (b'{"command": "stop", "x": ' + b"[" * 5000 + b"]" * 5000 + b"}", "stop"),
    (b'{"command": "stop", "x": ' + b"9" * 6000 + b"}", "stop"),
    (b'{"command": "stop", "x": "\\ud800"}', "stop"),
    (b'{"command": "stop", "x": "\xff"}', "stop"),
    (b'{"command": "\\u0073top", "x": ', "stop"),
    (b'\xef\xbb\xbf{"command": "stop"}', "stop"),
    ('{"command": "stop"}'.encode("utf-16"), "stop"),
    ('{"command": "stop"}'.encode("utf-16-be"), "stop"),
    ('{"command": "stop"}'.encode("utf-32"), "stop"),
    (b'{"command": "estop", "data": {"activate": false}, "timestamp": "x"}', ""),
    (b'{"command": "estop", "data": {"activate": fal', "emergency_stop"),
    (b'{"command": "locomotion_velocity", "data": {"duration_ms": 0}, "timestamp": "x"}', "stop"),
    (b'{"command": "velocity_command", "velocity_command": {"gait": "stand"}}', "stop"),
    (b'{"command": "locomotion_velocity", "data": {"duration_ms": 100}}', ""),
]


@pytest.mark.parametrize(("payload", "word"), REFUSED)
def test_what_a_decoder_refuses_is_a_stop_when_it_names_one(payload, word):
    assert stop_in(payload) == word


@pytest.mark.parametrize("payload", [b'{"command": "cancel"', b'{"command": "Cancel", "timestamp": "x"}'])
def test_a_cancel_is_a_stop_where_tasks_are_asked_for_and_nowhere_else(payload):
    assert [stop_in(payload, kind) for kind in ("navigate", "mission", "command")] == ["stop", "stop", ""]


@given(st.binary(max_size=200))
def test_no_bytes_break_the_search_for_a_stop(payload):
    assert stop_in(payload) in {"", *STOP_WORDS}


@given(
    st.sampled_from(sorted(STOP_WORDS)),
    st.dictionaries(
        st.text(max_size=8), st.recursive(st.none() | st.floats() | st.text(), st.lists, max_leaves=8)
    ),
    st.integers(0, 400),
)
def test_a_stop_that_is_cut_short_behind_its_name_is_one(word, more, cut):
    head = f'{{"command": "{word}", '
    payload = (head + json.dumps(more)[1:]).encode()[: len(head) + cut]
    found = None
    try:
        found = DECODERS["command"](payload)
    except WireError:
        found = stop_in(payload)
    assert getattr(found, "name", found) in STOP_WORDS or more.keys() & {"command", "type", "status"}
