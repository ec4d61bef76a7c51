"""Frames are cut and checked as the dialect says, whatever else is on the line."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink import payload_messages
from fleet_mavlink.codec import FrameSettings, Packer, Parser, pack
from fleet_mavlink.messages import Attitude, CommandInt, CommandLong, Heartbeat, SetPositionTargetLocalNed

GREETING = b"\n\nInit ArduCopter V4.6.3 (92b0cd78)\n\nFree RAM: 131072\nInit Gyro***"
BEAT = mav.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)
ATTITUDE = mav.MAVLink_attitude_message(1234, 0.1, -0.2, 3.0, 0, 0, 0)


def test_a_frame_of_another_implementation_is_read(frame_of):
    (frame,) = Parser().feed(frame_of(ATTITUDE, system=7, component=1))
    assert (frame.system, frame.component) == (7, 1)
    assert isinstance(frame.message, Attitude)
    assert frame.message.time_boot_ms == 1234
    assert frame.message.yaw == pytest.approx(3.0)


def test_a_frame_of_ours_is_read_by_another_implementation():
    data = pack(CommandLong(400, 1, 1, 2, param1=1.0, param2=21196.0), 245, 191, 9)
    (message,) = mav.MAVLink(None).parse_buffer(bytearray(data))
    assert message.get_type() == "COMMAND_LONG"
    assert (message.command, message.confirmation, message.param1, message.param2) == (400, 2, 1.0, 21196.0)
    assert (message.get_srcSystem(), message.get_srcComponent(), message.get_seq()) == (245, 191, 9)


def test_nan_goes_over_the_wire():
    data = pack(CommandLong(22, 1, param5=math.nan), 245, 191, 0)
    (message,) = mav.MAVLink(None).parse_buffer(bytearray(data))
    assert math.isnan(message.param5)


def test_text_before_the_first_frame_is_stepped_over(frame_of):
    assert len(Parser().feed(GREETING + frame_of(BEAT) + GREETING + frame_of(BEAT))) == 2


def test_frames_are_found_one_byte_at_a_time(frame_of):
    parser = Parser()
    data = GREETING + frame_of(BEAT) + b"\xfd\xfe\xfd" + frame_of(ATTITUDE) + frame_of(BEAT)
    frames = [frame for byte in data for frame in parser.feed(bytes([byte]))]
    assert [type(frame.message) for frame in frames][:1] == [Heartbeat]
    # What the stray magic bytes hold back comes with what follows.
    frames += parser.feed(frame_of(BEAT) * 20)
    assert [type(frame.message) for frame in frames[:3]] == [Heartbeat, Attitude, Heartbeat]


def test_mavlink_1_is_read():
    short = BEAT.pack(mav.MAVLink(None, srcSystem=3, srcComponent=1), force_mavlink1=True)
    assert short[0] == 0xFE
    (frame,) = Parser().feed(bytes(short))
    assert (frame.system, frame.message.custom_mode) == (3, 4)


def test_a_signed_frame_is_read_and_the_next_one_too(frame_of):
    signer = mav.MAVLink(None, srcSystem=4, srcComponent=1)
    signer.signing.secret_key = b"k" * 32
    signer.signing.sign_outgoing = True
    signed = bytes(BEAT.pack(signer))
    assert signed[2] == 1
    assert [frame.system for frame in Parser().feed(signed + frame_of(BEAT, system=5))] == [4, 5]


def test_a_broken_frame_is_dropped_and_the_next_one_read(frame_of):
    broken = bytearray(frame_of(BEAT, system=1))
    broken[12] ^= 0x40
    frames = Parser().feed(bytes(broken) + frame_of(BEAT, system=2))
    assert [frame.system for frame in frames] == [2]


def test_a_message_that_the_dialect_does_not_know_names_no_vehicle(frame_of):
    unknown = bytearray(frame_of(BEAT))
    unknown[7:10] = (410).to_bytes(3, "little")
    frames = Parser().feed(bytes(unknown) + frame_of(BEAT, system=2))
    assert [(frame.system, frame.component) for frame in frames] == [(2, 1)]


def test_a_message_of_no_interest_is_not_decoded(frame_of):
    vibration = mav.MAVLink_vibration_message(1, 0, 0, 0, 0, 0, 0)
    assert [type(frame.message) for frame in Parser().feed(frame_of(vibration) + frame_of(BEAT))] == [
        Heartbeat
    ]


def test_the_sequence_number_goes_round():
    packer = Packer(245, 191)
    numbers = [packer.pack(Heartbeat(6, 8))[4] for _ in range(300)]
    assert numbers[:3] == [1, 2, 3]
    assert numbers[255:258] == [0, 1, 2]


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_garbage_never_raises_and_never_piles_up(pieces):
    parser = Parser()
    for piece in pieces:
        parser.feed(piece)
    assert len(parser._rest) <= 293  # one frame at most


@given(st.lists(st.integers(1, 40), min_size=1, max_size=30), st.binary(max_size=30))
def test_frames_are_the_same_however_they_are_cut(cuts, junk):
    # Junk without a magic byte: such a byte may hold back what follows until the frame it promises is full.
    junk = junk.replace(b"\xfd", b"").replace(b"\xfe", b"")
    packer = Packer(245, 191)
    data = junk + b"".join(packer.pack(Heartbeat(2, 12, custom_mode=each)) for each in range(8))
    parser, at, found = Parser(), 0, []
    for cut in cuts * 40:
        found += parser.feed(data[at : at + cut])
        at += cut
    assert [frame.message.custom_mode for frame in found] == list(range(8))[: len(found)]
    assert at < len(data) or len(found) == 8


floats = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(floats, floats, floats, floats)
def test_a_setpoint_survives_the_wire(vx, vy, vz, yaw_rate):
    ours = SetPositionTargetLocalNed(1, 1, 1, 0x5C7, vx, vy, vz, yaw_rate)
    (read,) = mav.MAVLink(None).parse_buffer(bytearray(pack(ours, 245, 191, 0)))
    assert (read.vx, read.vy, read.vz, read.yaw_rate) == (vx, vy, vz, yaw_rate)
    assert (read.x, read.y, read.z, read.type_mask) == (0, 0, 0, 1479)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))
def test_a_place_survives_the_wire(x, y):
    (read,) = mav.MAVLink(None).parse_buffer(bytearray(pack(CommandInt(192, x=x, y=y), 245, 191, 0)))
    assert (read.x, read.y) == (x, y)


def test_a_message_that_version_1_does_not_have_is_said_in_version_2():
    key = payload_messages.SetupSigning(1, 1, tuple(range(32)), 5)
    (message,) = mav.MAVLink(None).parse_buffer(pack(key, 245, 191, 0, FrameSettings(version=1)))
    assert list(message.secret_key) == list(range(32))
