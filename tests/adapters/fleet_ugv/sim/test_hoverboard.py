"""A simulated hoverboard mainboard: the frames that it takes, its mixer, its feedback, and its stop."""

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet_ugv.codecs.hoverboard import checksum, frame_of
from fleet_ugv.sim.hoverboard import HoverboardBoard
from fleet_ugv.sim.physics import BaseBody

BODY = BaseBody(track=0.5, lag=0.0, sticks=0.0, fastest=20.0)
DIAMETER = 0.6 / math.pi  # m: one turn a minute is 0.01 m/s


def board_of():
    return HoverboardBoard(BODY, diameter=DIAMETER)


@pytest.fixture
def board():
    return board_of()


def feedback(board, now):
    """Return steer, speed, rpm of right and left, volts x 100 of what it says now."""
    data = board.step(now)
    assert (len(data), data[:2]) == (18, b"\xcd\xab")
    assert struct.unpack_from("<H", data, 16)[0] == checksum(data)
    return struct.unpack_from("<hhhhh", data, 2)


@pytest.mark.parametrize(
    ("steer", "speed", "wanted"),
    [
        (0, 50, [0.5, 0.5]),
        (0, -50, [-0.5, -0.5]),
        (40, 0, [0.2, -0.2]),  # to the right
        (40, 50, [0.7, 0.3]),
        (0, 1500, [10.0, 10.0]),
        (1000, 800, [10.0, 3.0]),  # each side is clamped by itself
    ],
)
def test_half_of_the_steer_is_added_to_each_side(board, steer, speed, wanted):
    assert board.receive(frame_of(steer, speed), 0.0) == b""
    assert board.physics.wanted == pytest.approx(wanted)


def test_it_says_its_inputs_its_speeds_and_its_voltage_every_20_ms(board):
    board.receive(frame_of(10, 50), 0.0)
    assert feedback(board, 0.5) == (10, 50, 45, 55, 3850)
    assert board.step(0.51) == b""
    assert len(board.step(0.525)) == 18


def test_a_lower_voltage_is_said(board):
    board.set_fault("low_battery", 31.2)
    assert feedback(board, 0.1)[4] == 3120


def test_it_stops_eight_tenths_of_a_second_after_its_last_frame(board):
    board.receive(frame_of(0, 50), 0.0)
    board.step(0.79)
    assert any(board.physics.wanted)
    board.step(0.83)
    assert board.physics.wanted == [0.0, 0.0]


@pytest.mark.parametrize("place", range(8))
def test_a_frame_with_a_spoiled_byte_is_none(board, place):
    frame = bytearray(frame_of(10, 50))
    frame[place] ^= 0x10
    board.receive(bytes(frame), 0.0)
    assert board.physics.wanted == [0.0, 0.0]


@settings(max_examples=25)
@given(st.binary(max_size=12), st.integers(0, 8))
def test_a_frame_is_found_behind_junk_and_in_parts(junk, cut):
    board, frame = board_of(), junk + frame_of(0, 50)
    board.receive(frame[:cut], 0.0)
    board.receive(frame[cut:], 0.0)
    assert board.physics.wanted == pytest.approx([0.5, 0.5])


def test_the_last_of_several_frames_counts(board):
    board.receive(frame_of(0, 20) + frame_of(0, 50) + frame_of(0, 30), 0.0)
    assert board.physics.wanted == pytest.approx([0.3, 0.3])


def test_a_reset_stands_still_and_forgets_half_a_frame(board):
    board.receive(frame_of(0, 50) + frame_of(0, 70)[:5], 0.0)
    board.restart(0.1)
    board.receive(frame_of(0, 70)[5:], 0.1)
    assert board.physics.wanted == [0.0, 0.0]
    assert feedback(board, 0.2)[:2] == (0, 0)
