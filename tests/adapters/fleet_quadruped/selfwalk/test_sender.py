"""Frames to a self-walking machine: a velocity as it is described, with counters and checksums."""

import struct

import pytest

from fleet import CanFrame
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.frame_integrity import Checksum, Counter
from fleet_quadruped.frames import FieldMap, FrameMap
from fleet_quadruped.selfwalk.sender import FrameSender
from fleet_quadruped.selfwalk.wire import WalkerWire

PLAIN = FrameMap(
    id=0x111,
    fields={name: FieldMap(at=2 * at, type="i16", scale=0.001) for at, name in enumerate(("x", "y", "turn"))},
)
GUARDED = FrameMap.model_validate(
    PLAIN.model_dump() | {"id": 0x112, "counter": Counter(at=6), "checksum": Checksum(at=7)}
)


class Bus(list):
    """A bus that keeps what is sent."""

    send = list.append


@pytest.fixture
def bus():
    return Bus()


def sender(bus, *velocities):
    protected = {frame.id: frame for frame in velocities if frame.integrity_bytes}
    return FrameSender(bus, WalkerWire(velocities, {}, None, (PLAIN,), (), protected=protected))


def test_a_velocity_is_sent_in_the_units_and_places_of_its_frame(bus):
    sender(bus, PLAIN).send(Twist(0.5, -0.25, 1.0))
    assert bus == [CanFrame(0x111, struct.pack("<3h", 500, -250, 1000))]


def test_a_velocity_of_several_frames_is_sent_in_all_of_them(bus):
    ahead, turn = (
        FrameMap(id=number, fields={name: PLAIN.fields[name].model_copy(update={"at": 0})})
        for number, name in ((0x111, "x"), (0x113, "turn"))
    )
    sender(bus, ahead, turn).send(Twist(0.5, 0.0, 1.0))
    assert [(frame.id, frame.data) for frame in bus] == [(0x111, b"\xf4\x01"), (0x113, b"\xe8\x03")]


def test_each_frame_has_the_next_count_and_the_sum_of_its_bytes(bus):
    frames = sender(bus, GUARDED)
    for _ in range(3):
        frames.send(Twist(0.001, 0.0, 0.0))
    assert [frame.data for frame in bus] == [
        b"\x01\0\0\0\0\0\x00\x01",
        b"\x01\0\0\0\0\0\x01\x02",
        b"\x01\0\0\0\0\0\x02\x03",
    ]


def test_frames_of_one_identifier_share_a_counter(bus):
    frames = sender(bus, GUARDED)
    frames.send(Twist())
    frames.put(CanFrame(0x112, bytes(8)))
    frames.send(Twist())
    assert [frame.data[6] for frame in bus] == [0, 1, 2]


def test_a_frame_without_protection_is_sent_as_it_is(bus):
    frame = CanFrame(0x42, b"\x01\x02")
    sender(bus, GUARDED).put(frame)
    assert bus == [frame]


def test_a_velocity_that_is_no_number_is_not_sent(bus):
    with pytest.raises(ValueError, match="x is not a number"):
        sender(bus, PLAIN).send(Twist(float("nan"), 0.0, 0.0))
    assert bus == []
