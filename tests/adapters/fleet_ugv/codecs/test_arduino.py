import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.testing.wires import OneByteAtATime
from fleet_ugv.codecs.arduino import ArduinoCodec, Servo
from fleet_ugv.model import AckermannCommand, BaseFault, Feedback, Wheels


def make(**fields):
    return ArduinoCodec(ticks=3000.0, **fields)


def test_golden_bytes():
    codec = make()
    assert codec.motion(Wheels(0.5, -0.25)) == b"m 50 -25\r"
    assert codec.motion(Wheels(1e6, 0.0)) == b"m 32767 0\r"
    assert codec.poll() == b"e\r"
    assert codec.stop == codec.setup() == b"\rm 0 0\r"
    assert codec.hello() == b"\r"


def test_a_car_is_steered_by_a_servo():
    codec = make(servo=Servo(number=1, centre=90.0, gain=math.degrees(1)))
    assert codec.motion(AckermannCommand(0.5, math.radians(20))) == b"s 1 110\rm 50 50\r"
    assert codec.motion(AckermannCommand(0.5, -3.0)) == b"s 1 0\rm 50 50\r"


def test_counters_become_metres():
    assert make().feed(b"3000 -1500\r\n") == [Feedback(distances=(1.0, -0.5))]


def test_an_acknowledgement_says_nothing_and_an_unknown_command_is_a_trouble():
    codec = make()
    assert codec.feed(b"OK\r\n") == []
    assert codec.garbage == 0
    assert isinstance(codec.feed(b"Invalid Command\r\n")[0], BaseFault)


@pytest.mark.parametrize("line", [b"1 2 3", b"12", b"1.5 2", b"99999999999 1", b"\xff\xfe", b"O K"])
def test_what_makes_no_sense_is_counted(line):
    codec = make()
    assert codec.feed(line + b"\n") == []
    assert codec.garbage == 1


def test_answers_are_the_same_after_an_echo_and_however_they_are_cut():
    codec, stream = make(), b"e\r3000 0\r\nm 50 50\rOK\r\n0 -3000\r\n"
    said = [event for piece in OneByteAtATime().carry(stream) for event in codec.feed(piece)]
    assert [feedback.distances for feedback in said] == [(1.0, 0.0), (0.0, -1.0)]
    assert codec.garbage == 0


@given(st.lists(st.binary(max_size=50)))
def test_nothing_that_arrives_raises(pieces):
    codec = make()
    for piece in pieces:
        codec.feed(piece)
