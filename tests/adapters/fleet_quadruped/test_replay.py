"""Captured frames as lines: what the drives were, and how far a joint was from its target."""

import pytest

from fleet import CanFrame
from fleet_quadruped.can.capture import Captured
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.cia402.frames import EMERGENCY, RPDO1, TPDO1, CountUnits
from fleet_quadruped.replay import DriveReplay, SilentBus

ENABLED, READY, FAULT = 0x1237, 0x0231, 0x0218
OVER_CURRENT = bytes.fromhex("1023210000000000")
START = 1_795_000_000.0  # Unix s, as a capture has it


class Log:
    """Frames of the joints of a dog, in the order in which they are added."""

    def __init__(self, dog):
        self.dog, self.frames = dog, []

    def answer(self, at, joint, angle, *, torque=0.0, status=ENABLED):
        return self._add(at, joint, TPDO1, CountUnits(self._joint(joint)).pack(status, angle, torque))

    def target(self, at, joint, angle):
        return self._add(at, joint, RPDO1, CountUnits(self._joint(joint)).pack(0x0F, angle, 0.0), sent=True)

    def emergency(self, at, joint, data=OVER_CURRENT):
        return self._add(at, joint, EMERGENCY, data)

    def lines(self, only=""):
        return list(DriveReplay(self.dog).lines(self.frames, only))

    def _joint(self, name):
        return next(joint for joint in self.dog.all_joints if joint.name == name)

    def _add(self, at, joint, base, data, *, sent=False):
        frame = CanFrame(base + self._joint(joint).id, data)
        self.frames.append(Captured(START + at, "a", frame, sent))
        return self


@pytest.fixture
def log(dog):
    return Log(dog)


def targets(lines):
    return [line for line in lines if "wanted" in line]


def test_a_drive_is_fed_with_what_it_said_and_not_with_what_it_was_sent(log):
    log.target(0.0, "RL_hip", 0.9).answer(0.1, "RL_hip", 0.5, torque=2.0)
    replay = DriveReplay(log.dog)
    replay.apply(log.frames[0])
    assert replay.wanted == pytest.approx({"RL_hip": 0.9}, abs=1e-4)
    assert {reported.power for reported in replay.reported} == {Power.ABSENT}
    replay.apply(log.frames[1])
    joint = replay.reported[7]
    assert (joint.power, joint.age) == (Power.ENABLED, 0.0)
    assert (joint.angle, joint.torque) == (pytest.approx(0.5, abs=1e-4), pytest.approx(2.0, abs=0.01))


def test_each_change_of_a_drive_is_one_line(log):
    log.answer(0.0, "RL_hip", 0.5, status=READY).answer(0.5, "RL_hip", 0.5).answer(1.0, "RL_hip", 0.5)
    log.emergency(1.5, "RL_hip").answer(2.0, "RL_hip", 0.5, status=FAULT)
    said = [line for line in log.lines() if "RL_hip" in line]
    assert said == [
        "  -2.000 s  RL_hip   is starting",
        "  -1.500 s  RL_hip   is enabled",
        "  -0.500 s  RL_hip   is enabled: over-current (emergency 2310h, register 21h)",
        "   0.000 s  RL_hip   is fault: over-current (emergency 2310h, register 21h)",
    ]


def test_a_drive_that_has_said_nothing_is_absent(log):
    log.answer(0.0, "RL_hip", 0.5)
    assert "   0.000 s  FL_abad  is absent" in log.lines()


def test_the_joint_that_is_farthest_from_its_target_is_told_ten_times_a_second(log):
    for step in range(31):
        at = step / 100
        log.target(at, "RL_hip", 0.6).target(at, "FR_knee", -1.0)
        log.target(at, "FL_hip", 0.1).answer(at, "FL_hip", 1.0, torque=1.0)
        log.answer(at, "RL_hip", 0.5, torque=-2.0).answer(at, "FR_knee", -1.5, torque=1.0)
    found = targets(log.lines())
    assert len(found) == 4
    assert found[-1].endswith("FL_hip   wanted   0.100 rad, is at   1.000,   1.00 N m")


def test_one_joint_is_told_that_a_person_asked_for(log):
    log.target(0.0, "RL_hip", 0.6).answer(0.0, "RL_hip", 0.5, torque=-2.0).target(0.2, "FR_knee", -1.0)
    assert targets(log.lines("RL_hip"))[-1] == (
        "   0.000 s  RL_hip   wanted   0.600 rad, is at   0.500,  -2.00 N m"
    )
    assert log.lines("FL_hip")[-1] == "   0.000 s  FL_hip   was sent no target"


def test_without_targets_no_distance_is_told(log):
    log.answer(0.0, "RL_hip", 0.5)
    assert not [line for line in log.lines() if "target" in line or "wanted" in line]


def test_an_empty_capture_has_no_lines(log):
    assert log.lines() == []


def test_a_silent_bus_takes_frames_and_has_none():
    bus = SilentBus("a")
    bus.send(CanFrame(1, b""))
    assert bus.receive(10.0) == []
    bus.close()
