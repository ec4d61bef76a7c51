"""A simulated Waveshare board: its commands, its feedback in the units of its firmware, and its flaws."""

import json
import math

import pytest

from fleet_ugv.sim.physics import BaseBody
from fleet_ugv.sim.waveshare import BOOT, WaveshareBoard

BODY = BaseBody(track=0.2, lag=0.0, sticks=0.0, fastest=2.0, bias=0.0, noise=0.0)
START = 1.0  # s: it has booted


class Bench:
    def __init__(self, *, general=False):
        self.board = WaveshareBoard(BODY, general=general)
        self.board.step(START)

    def send(self, *, at=START, **command):
        return self.board.receive(json.dumps(command).encode() + b"\n", at)

    @property
    def wanted(self):
        return self.board.physics.wanted

    def feedback(self, at=START):
        return json.loads(self.send(at=at, T=130).splitlines()[-1])


@pytest.fixture
def ros():
    return Bench()


@pytest.fixture
def general():
    bench = Bench(general=True)
    bench.send(T=143, cmd=0)  # no echo
    return bench


def test_while_it_boots_it_prints_text_and_takes_nothing():
    board = WaveshareBoard(BODY)
    assert b"rst:0x1 (POWERON_RESET)" in board.step(0.01)
    assert board.step(0.1) == b""
    assert board.receive(b'{"T":1,"L":0.2,"R":0.2}\n{"T":130}\n', BOOT - 0.01) == b""
    assert board.physics.wanted == [0.0, 0.0]
    assert board.receive(b'{"T":130}\n', BOOT) != b""


def test_wheels_have_the_speeds_of_t_1_until_its_dead_man_acts(ros):
    ros.send(T=1, L=0.2, R=-0.1)
    assert ros.wanted == [0.2, -0.1]
    ros.board.step(START + 2.9)
    assert ros.wanted == [0.2, -0.1]
    ros.board.step(START + 3.1)
    assert ros.wanted == [0.0, 0.0]


def test_the_time_of_its_dead_man_is_set_in_milliseconds_until_it_restarts(ros):
    ros.send(T=136, cmd=500)
    ros.send(T=1, L=0.2, R=0.2)
    ros.board.step(START + 0.6)
    assert ros.wanted == [0.0, 0.0]
    ros.board.set_fault("reset", 1.0)
    assert ros.board.timeout == 3.0


def test_a_board_that_does_not_take_the_time_keeps_its_own(ros):
    ros.board.set_fault("no_confirm", 1.0)
    ros.send(T=136, cmd=500)
    assert ros.board.timeout == 3.0


@pytest.mark.parametrize("speed", [2.01, -2.01])
def test_a_wheel_that_is_too_fast_is_ignored(ros, speed):
    ros.send(T=1, L=0.2, R=0.2)
    ros.send(T=1, L=0.1, R=speed)
    assert ros.wanted == [0.2, 0.2]


def test_t_13_turns_about_its_track(ros):
    ros.send(T=13, X=0.3, Z=1.0)
    assert ros.wanted == pytest.approx([0.2, 0.4])


def test_t_0_stops_the_ros_firmware_and_nothing_of_the_general_one(ros, general):
    for bench in (ros, general):
        bench.send(T=1, L=0.2, R=0.2)
        bench.send(T=0)
    assert (ros.wanted, general.wanted) == ([0.0, 0.0], [0.2, 0.2])


def test_a_missing_kind_is_0(ros):
    ros.send(T=1, L=0.2, R=0.2)
    ros.send(X=1)
    assert ros.wanted == [0.0, 0.0]


def test_the_ros_firmware_streams_its_feedback_every_50_ms(ros):
    said = [ros.board.step(START + step / 100) for step in range(1, 101)]
    assert 17 <= sum(bool(each) for each in said) <= 20
    ros.send(T=131, cmd=0, at=START + 1.0)
    assert ros.board.step(START + 2.0) == b""


def test_the_general_firmware_says_nothing_until_it_is_asked_and_echoes_at_first():
    bench = Bench(general=True)
    assert bench.board.step(START + 1.0) == b""
    assert bench.send(T=1, L=0, R=0) == b'{"T": 1, "L": 0, "R": 0}\n'
    bench.send(T=143, cmd=0)
    assert bench.send(T=1, L=0, R=0) == b""
    bench.send(T=131, cmd=1)
    assert bench.board.step(START + 1.1) != b""


def test_the_ros_firmware_reports_centimetres_centivolts_and_raw_steps(ros):
    ros.send(T=1, L=0.2, R=0.4)
    said = ros.feedback(START + 1.005)
    assert (said["T"], said["L"], said["R"]) == (1001, 0.2, 0.4)
    assert (said["odl"], said["odr"], said["v"]) == (20, 40, 1190)
    assert said["gz"] == pytest.approx(math.degrees(1.0) * 16.4, abs=1)  # 16.4 steps per degree a second
    assert said["az"] == pytest.approx(8192, abs=200)  # of gravity


def test_the_general_firmware_reports_degrees_and_volts(general):
    general.send(T=1, L=0.2, R=0.4)
    said = general.feedback(START + 1.0)
    assert said["y"] == pytest.approx(math.degrees(general.board.physics.yaw), abs=0.01)
    assert (said["v"], "odl" in said) == (11.9, False)


def test_a_speed_is_reported_in_steps_of_half_a_millimetre(ros):
    ros.send(T=1, L=0.1002, R=0.1003)
    said = ros.feedback(START + 0.5)
    assert (said["L"], said["R"]) == (0.1, 0.1005)


def test_a_display_a_lamp_and_a_mount_do_as_they_are_told(ros):
    ros.send(T=3, lineNum=1, Text="hello")
    assert ros.board.display == {1: "hello"}
    ros.send(T=-3)
    assert ros.board.display == {}
    ros.send(T=132, IO4=255, IO5=10)
    assert ros.board.lamps == (255, 10)
    ros.send(T=134, X=90, Y=30, SX=1024, SY=1024)  # 90 degrees a second
    ros.board.step(START + 0.5)
    assert ros.board.camera == pytest.approx((45.0, 30.0))
    ros.send(T=135, at=START + 0.5)
    ros.board.step(START + 2.0)
    assert ros.board.camera == pytest.approx((45.0, 30.0))


def test_the_angles_of_a_mount_are_reported_once_the_module_is_set(ros):
    assert "pan" not in ros.feedback()
    ros.send(T=900, main=2, module=2)
    assert (ros.feedback()["pan"], ros.feedback()["tilt"]) == (0.0, 0.0)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"nonsense",
        b"[1, 2]",
        b"3",
        b'{"T":1,"L":0.5',
        b'{"T":1e400}',
        b'{"T":132,"IO4":1e400,"IO5":1}',
        b"\xff\xfe",
        b"[" * 200,
    ],
)
def test_what_is_no_command_changes_nothing_and_breaks_nothing(ros, line):
    ros.send(T=1, L=0.2, R=0.2)
    assert ros.board.receive(line + b"\n", START) == b""
    assert ros.wanted == [0.2, 0.2]
    assert ros.feedback()["T"] == 1001


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (b'{"T":1}', [0.0, 0.0]),
        (b'{"T":1,"R":0.1}', [0.0, 0.1]),
        (b'{"T":1,"L":"a","R":null}', [0.0, 0.0]),
        (b'{"T":1,"L":"0.3","R":[1]}', [0.3, 0.0]),
        (b'{"T":"x"}', [0.0, 0.0]),  # T 0
        (b'{"T":13,"X":0.3}', [0.3, 0.3]),
    ],
)
def test_a_number_that_is_missing_or_none_is_0_as_arduino_json_has_it(ros, line, wanted):
    ros.send(T=1, L=0.2, R=0.2)
    assert ros.board.receive(line + b"\n", START) == b""
    assert ros.wanted == pytest.approx(wanted)


def test_a_wheel_that_is_too_fast_feeds_the_dead_man(ros):
    ros.send(T=1, L=0.2, R=0.2)
    ros.send(T=1, L=9, R=9, at=START + 2.0)
    ros.board.step(START + 4.9)
    assert ros.wanted == [0.2, 0.2]


def test_t_13_feeds_the_dead_man_of_the_general_firmware_alone(ros, general):
    for bench in (ros, general):
        bench.send(T=1, L=0.2, R=0.2)
        bench.send(T=13, X=0.3, Z=0, at=START + 2.0)
        bench.board.step(START + 3.5)
    assert (ros.wanted, general.wanted) == ([0.0, 0.0], [0.3, 0.3])


def test_a_line_that_is_too_long_is_lost_and_the_next_is_whole(ros):
    long = b'{"T":3,"lineNum":0,"Text":"' + b"y" * 240 + b'"}\n'
    ros.board.receive(long + b'{"T":1,"L":0.3,"R":0.3}\n', START)
    assert (ros.wanted, ros.board.display) == ([0.3, 0.3], {})


def test_a_reset_forgets_all_that_it_was_told(ros):
    ros.send(T=1, L=0.2, R=0.2)
    ros.send(T=900, main=2, module=2)
    ros.send(T=131, cmd=0)
    ros.board.step(START + 1.0)
    ros.board.set_fault("reset", 1.0)
    assert (ros.wanted, ros.board.physics.distances) == ([0.0, 0.0], [0.0, 0.0])
    assert b"rst:" in ros.board.step(START + 1.1)
    assert ros.board.step(START + 1.1 + BOOT) != b""  # it streams again
    assert "pan" not in ros.feedback(START + 2.0)
