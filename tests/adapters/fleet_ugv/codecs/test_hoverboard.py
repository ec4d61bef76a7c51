import math
import struct

from hypothesis import given
from hypothesis import strategies as st

from fleet.testing.wires import OneByteAtATime
from fleet_ugv.codecs.hoverboard import HoverboardCodec, checksum, frame_of
from fleet_ugv.model import Wheels

RPM = math.pi * 0.165 / 60  # m/s of one turn a minute


def make():
    return HoverboardCodec(diameter=0.165)


def said(right=60, left=30, volts=3850, degrees=312):
    bare = struct.pack("<HhhhhhhHH", 0xABCD, 0, 0, right, left, volts, degrees, 0, 0)
    return bare[:-2] + struct.pack("<H", checksum(bare))


def test_golden_bytes():
    assert make().stop == bytes.fromhex("cdab 0000 0000 cdab")
    assert frame_of(100, -200) == bytes.fromhex("cdab 6400 38ff 9154")
    assert make().motion(Wheels(100 * RPM, 100 * RPM)) == frame_of(0, 100)
    assert make().motion(Wheels(-50 * RPM, 50 * RPM)) == frame_of(-100, 0)


def test_a_frame_tells_both_sides_volts_and_heat():
    [feedback] = make().feed(said())
    assert feedback.speeds == (30 * RPM, 60 * RPM)
    assert (feedback.voltage, feedback.temperature) == (38.5, 31.2)


def test_frames_are_found_between_junk_and_byte_by_byte():
    codec = make()
    stream = b"\xcd\xab junk \xcd" + said() + b"\x00\xcd" + said(1, 2)
    events = [event for piece in OneByteAtATime().carry(stream) for event in codec.feed(piece)]
    assert [event.speeds[0] for event in events] == [30 * RPM, 2 * RPM]
    assert codec.garbage > 0


@given(st.integers(0, 17), st.integers(0, 7))
def test_a_flipped_bit_is_never_a_feedback(place, bit):
    spoiled = bytearray(said())
    spoiled[place] ^= 1 << bit
    assert make().feed(bytes(spoiled)) == []


@given(st.lists(st.binary(max_size=60)))
def test_nothing_that_arrives_raises_or_piles_up(pieces):
    codec = make()
    for piece in pieces:
        codec.feed(piece)
        assert len(codec._rest) <= 18


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_every_motion_is_a_frame_within_the_firmwares_range(left, right):
    frame = make().motion(Wheels(left, right))
    _, steer, speed, check = struct.unpack("<HhhH", frame)
    assert max(abs(steer), abs(speed)) <= 1000
    assert check == checksum(frame)
