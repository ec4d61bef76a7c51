import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.testing.wires import Corrupt, Lossy, OneByteAtATime
from fleet_ugv.codecs.waveshare import WaveshareCodec
from fleet_ugv.model import BaseFault, Confirmed, Feedback, Wheels

ROS = (
    b'{"T":1001,"L":0.12,"R":-0.1,"ax":0,"ay":0,"az":8192,"gx":0,"gy":0,"gz":164,"mx":0,"my":0,"mz":0,'
    b'"odl":1234,"odr":-20,"v":1187,"pan":90,"tilt":-10}\r\n'
)
GENERAL = b'{"T":1001,"L":0.5,"R":0.5,"r":1.0,"p":2.0,"y":90.0,"temp":31.5,"v":11.9}\n'


def make(module=2):
    return WaveshareCodec(main=3, module=module, timeout=0.5)


def test_the_ros_firmware_tells_counters_gyro_volts_and_the_mount():
    [said] = make().feed(ROS)
    assert said.distances == (12.34, -0.2)
    assert said.speeds == (0.12, -0.1)
    assert said.gyro.z == pytest.approx(math.radians(10))
    assert said.accel.z == pytest.approx(9.80665)
    assert said.voltage == 11.87
    assert (said.pan, said.tilt) == pytest.approx((math.pi / 2, math.radians(-10)))


def test_the_general_firmware_tells_a_heading_and_no_counters():
    [said] = make().feed(GENERAL)
    assert (said.distances, said.gyro, said.voltage) == (None, None, 11.9)
    assert said.yaw == pytest.approx(math.pi / 2)


def test_without_a_mount_its_zeros_are_not_believed_and_an_arm_spoils_the_acceleration():
    [said] = make(module=1).feed(ROS)
    assert (said.pan, said.tilt, said.accel) == (None, None, None)


def test_motion_is_wheel_speeds_within_what_the_firmware_does_not_ignore():
    assert make().motion(Wheels(0.25, -0.125)) == b'{"T":1,"L":0.2500,"R":-0.1250}\n'
    assert make().motion(Wheels(9.0, -9.0)) == b'{"T":1,"L":2.0000,"R":-2.0000}\n'


def test_a_stop_is_zero_wheels_and_the_boards_own_stop():
    assert make().stop == b'{"T":1,"L":0,"R":0}\n{"T":0}\n'


def test_it_greets_with_the_end_of_half_a_line_and_asks_for_one_feedback():
    assert make().hello() == b'\n{"T":130}\n'


def test_setup_stops_picks_the_geometry_sets_the_dead_man_and_has_it_echoed():
    messages = [json.loads(line) for line in make().setup().split(b"\n") if line]
    assert [each["T"] for each in messages] == [1, 900, 605, 143, 136, 143, 142, 131]
    assert messages[1] == {"T": 900, "main": 3, "module": 2}
    assert [messages[3]["cmd"], messages[4]["cmd"], messages[5]["cmd"]] == [1, 500, 0]


def test_the_echo_of_the_dead_man_confirms_it_and_another_time_does_not():
    assert make().feed(b'{"T":136,"cmd":500}\n') == [Confirmed()]
    assert make().feed(b'{"T":136,"cmd":3000}\n') == []


@pytest.mark.parametrize(
    ("requested", "bytes_"),
    [
        (lambda codec: codec.lights(255, 0), b'{"T":132,"IO4":255,"IO5":0}\n'),
        (lambda codec: codec.gimbal(-45, 30), b'{"T":134,"X":-45,"Y":30,"SX":600,"SY":600}\n'),
        (lambda codec: codec.gimbal(999, -99), b'{"T":134,"X":180,"Y":-30,"SX":600,"SY":600}\n'),
        (lambda codec: codec.display(["hi"]), b'{"T":3,"lineNum":0,"Text":"hi"}\n'),
        (lambda codec: codec.display([]), b'{"T":-3}\n'),
        (
            lambda codec: codec.display(["\n\u00e4" + "x" * 200]),
            b'{"T":3,"lineNum":0,"Text":"??' + b"x" * 58 + b'"}\n',
        ),
    ],
)
def test_golden_bytes_of_what_hangs_on_the_board(requested, bytes_):
    assert requested(make()) == bytes_


@pytest.mark.parametrize(
    "line", [b'{"T":1,"L":1,"R":1}', b'{"T":900,"main":3,"module":2}', b'{"T":1003,"x":1}']
)
def test_an_echo_or_news_of_others_is_no_garbage_and_says_nothing(line):
    codec = make()
    assert codec.feed(line + b"\n") == []
    assert codec.garbage == 0


@pytest.mark.parametrize(
    "line",
    [
        b"rst:0x1 (POWERON_RESET)",
        b"[1,2]",
        b'{"T":"1001","L":1,"R":1}',
        b'{"T":true}',
        b'{"T":1001,"L":null,"R":1}',
        b'{"T":1001,"L":1e999,"R":1}',
        b'{"T":1001,"L":55,"R":1}',
        b'{"T":123456}',
        b"[" * 900,
        b"\xff\x00",
    ],
)
def test_what_makes_no_sense_is_counted_and_says_nothing(line):
    codec = make()
    assert codec.feed(line + b"\n") == []
    assert codec.garbage == 1


def test_a_line_of_a_megabyte_is_skipped_to_its_end_and_the_next_is_read():
    codec = make()
    for _ in range(1024):
        assert codec.feed(b"x" * 1024) == []
    assert len(codec.feed(b"\n" + ROS)) == 1


def test_a_servo_that_is_not_there_is_a_trouble():
    assert isinstance(make().feed(b'{"T":1005,"id":1,"status":0}\n')[0], BaseFault)


def test_lines_are_the_same_however_they_are_cut():
    codec = make()
    pieces = [piece for data in (ROS, GENERAL) for piece in OneByteAtATime().carry(data)]
    assert [event for piece in pieces for event in codec.feed(piece)] == [
        *make().feed(ROS),
        *make().feed(GENERAL),
    ]


@given(st.integers(0, 1000), st.sampled_from([Corrupt, Lossy]))
def test_a_spoiled_line_never_raises_and_never_tells_an_impossible_speed(seed, wire):
    codec, worn = make(), wire(seed, rate=0.5)
    for piece in [ROS[:40], ROS[40:], GENERAL] * 10:
        for spoiled in worn.carry(piece):
            for event in codec.feed(spoiled):
                assert not isinstance(event, Feedback) or max(map(abs, event.speeds)) <= 10
