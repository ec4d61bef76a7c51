"""Every decoder of what comes from outside: it reads, or it raises WireError, and nothing else.

The usual run tries a hundred cases of each. 100,000 of each:
``python3 run.py test --soak tests/fleet/wire/test_bad_input.py``.
"""

import contextlib
import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.command import Transport
from fleet.wire.commands import MotionDefaults, decode_command, decode_motion
from fleet.wire.databus import decode_report
from fleet.wire.documents import document_in, document_out
from fleet.wire.edge_heartbeat import read_heartbeat
from fleet.wire.joints import decode_joints
from fleet.wire.missions import decode_mission
from fleet.wire.navigation import decode_navigate
from fleet.wire.ping import check_ping, is_clouds_pong
from fleet.wire.rules import (
    ENVIRONMENT,
    INWARD,
    RULES,
    WORKFLOW_CANCEL,
    WORKFLOW_RUN,
    Recipient,
    TopicForm,
)
from fleet.wire.topics import Topics, parse_data_key
from fleet.wire.workflows import decode_workflow
from tests.tools.garbage import leaves_nothing

DEFAULTS = MotionDefaults(0.5, 0.5, 0.5, 0.5)
CLOUD = {
    "command": lambda payload: decode_command(
        payload, transport=Transport.CLOUD, defaults=lambda _: DEFAULTS
    ),
    "navigate": lambda payload: decode_navigate(payload, transport=Transport.CLOUD, rotation_order="auto"),
    "motion": lambda payload: decode_motion(payload, transport=Transport.CLOUD),
    "joints": lambda payload: decode_joints(payload, transport=Transport.CLOUD),
    "mission": lambda payload: decode_mission(payload, transport=Transport.CLOUD),
    "edge_health": read_heartbeat,
    "ping:request": check_ping,
    "pong:response": is_clouds_pong,
    WORKFLOW_RUN: decode_workflow,
    WORKFLOW_CANCEL: decode_workflow,
}
"""By taker, and by suffix of what the bridge takes itself."""


def _relayed(suffix):
    return lambda payload: document_in(suffix.replace("+", "update"), payload, size=1 << 20, now=1.0)


def _sample(rule):
    if rule.form is TopicForm.DOCUMENT:
        suffix = rule.suffix.replace("+", "update")
        return lambda sample: document_out(suffix, sample, source_type="edge", session="s")
    return lambda sample: decode_report(rule.channel, sample)


DECODERS = {
    **{f"in {name}": decode for name, decode in CLOUD.items()},
    **{
        f"in {rule.suffix}": _relayed(rule.suffix)
        for rule in INWARD.values()
        if rule.taker is Recipient.RELAY
    },
    **{f"bus {rule.channel}": _sample(rule) for rule in RULES.values() if rule.channel},
    "bus setpoint": lambda sample: decode_motion(sample, transport=Transport.BUS),
    "topic": lambda payload: Topics("").parse(payload.decode(errors="surrogateescape")),
    "key": lambda payload: parse_data_key(payload.decode(errors="surrogateescape")),
}

# fmt: off
WORDS = st.sampled_from([
    "command", "type", "data", "timestamp", "ts", "source_type", "session_id", "action_id",
    "status", "stop", "cancel", "emergency_stop", "goto", "path", "move", "move_forward",
    "takeoff", "position", "rotation", "waypoints", "yaw", "linear", "angular", "linear_x",
    "angular_z", "x", "y", "z", "w", "positions", "velocities", "efforts", "target_positions",
    "joint_name", "joint_state", "mission_execution_uuid", "sdp", "target", "offer", "answer",
    "candidate", "edge_health", "edge_id", "uptime_seconds", "ping", "pong", "names", "fields",
    "level", "message", "tele", "edge", "sim", "velocity_command", "contract", "duration_ms",
    "locomotion.velocity_command.v1", "geodetic_position", "latitude", "longitude", "altitude",
    "constraints", "metadata", "max_loops", "name", "event_type", "map_type", "content_type",
    "shape", "dtype", "uint16", "float32", "numpy/ndarray", "application/json",
])
# fmt: on
NUMBERS = st.integers() | st.floats() | st.sampled_from([0, -1, 1e308, 2**63, -(2**64), 10**30])
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | WORDS | st.text(max_size=6),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(WORDS | st.text(max_size=4), inner, max_size=6)
    ),
    max_leaves=12,
)
OBJECTS = st.dictionaries(WORDS, VALUES, max_size=8)
TEXTS = OBJECTS.map(lambda value: json.dumps(value).encode())


@st.composite
def doubled(draw):
    """Return an object one key of which stands twice."""
    first, second = draw(TEXTS), draw(TEXTS)
    return first[:-1] + b"," * (len(first) > 2 and len(second) > 2) + second[1:]


@st.composite
def framed(draw):
    """Return bytes behind a header that is right, or nearly."""
    header = json.dumps(draw(OBJECTS) | draw(st.sampled_from(HEADERS))).encode()
    body = draw(TEXTS | st.binary(max_size=40))
    length = 16 + len(header) + draw(st.sampled_from([0, 0, 0, 1, -1, -17, 1 << 20]))
    return struct.pack("<Idq", length % (1 << 32), draw(st.floats()), draw(st.integers(0, 9))) + header + body


HEADERS = [
    {"content_type": "application/json"},
    {"content_type": "numpy/ndarray", "shape": [1, 3], "dtype": "float32"},
    {"content_type": "numpy/ndarray", "shape": [2, 1], "dtype": "uint16"},
    {"content_type": "text/plain"},
    {},
]
HOSTILE = st.one_of(
    TEXTS,
    doubled(),
    framed(),
    st.binary(max_size=80),
    st.integers(1, 3000).map(lambda depth: b'{"data":' + b"[" * depth),
    st.integers(30, 40).map(lambda depth: b'{"a":' * depth + b"1" + b"}" * depth),
    TEXTS.map(lambda text: text.decode().encode("utf-16")),
    TEXTS.map(lambda text: text.replace(b"1", b"1" * 400)),
)


def test_every_decoder_of_the_table_is_here():
    requested = {rule.taker.value for rule in INWARD.values() if rule.taker.is_request}
    own = {rule.suffix for rule in INWARD.values() if rule.taker is Recipient.EDGE}
    assert requested | own == set(CLOUD)
    assert f"in {ENVIRONMENT}" in DECODERS


@given(HOSTILE)
def test_every_decoder_reads_or_refuses_and_does_nothing_else(payload):
    for decode in DECODERS.values():
        with contextlib.suppress(WireError):
            decode(payload)


BAD = (
    b"",
    b"{",
    b"[1]",
    b"5",
    b'{"command": 5}',
    b'{"type": 5}',
    b"\xff\xfe",
    b'{"a": 1, "a": 2}',
    b"[" * 99,
)


def test_a_refusal_keeps_nothing_alive_until_the_garbage_collector_looks():
    def refuse_all():
        for decode in DECODERS.values():
            for payload in BAD:
                with contextlib.suppress(WireError):
                    decode(payload)

    refuse_all()  # what is made once
    assert leaves_nothing(refuse_all)


def test_32_mib_of_nothing_are_refused_by_all():
    payload = b'{"x": "' + b"x" * (32 * 1024 * 1024)
    for name, decode in DECODERS.items():
        if name not in ("topic", "key"):
            with pytest.raises(WireError):
                decode(payload)
