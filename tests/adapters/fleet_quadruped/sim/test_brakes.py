"""The stops of a simulated CiA 402 drive, as 605Ah, 605Ch, 605Eh and 6007h choose them."""

import pytest

from fleet.link.canbus.frame import CanFrame
from fleet_quadruped.drives.cia402.frames import OPERATIONAL, RPDO1, SYNC, pack_target
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.sim.cia402 import SimDrive
from fleet_quadruped.sim.world import SimMotor

QUICK_STOP, DISABLE_OPERATION, ENABLE, VOLTAGE_OFF = 0x02, 0x07, 0x0F, 0x00


class Turning:
    """One enabled drive, whose motor turns at 2 rad/s and does what its drive says at once."""

    def __init__(self, dog, **options):
        self.motor = SimMotor(speed=2.0)
        self.drive = SimDrive(dog.all_joints[0], self.motor, lambda frame: None, dog.drive)
        for place, value in options.items():
            self.drive.sdo.objects[int(place[1:], 16), 0].value = value
        self.drive.sdo.objects[0x1016, 1].value = 100
        self.drive.nmt = OPERATIONAL
        for word in (0x06, 0x07, 0x0F):
            self.tell(word)
        assert self.drive.state is DriveState.ENABLED

    def tell(self, word):
        """Tell the drive a control word."""
        self.drive.hears[RPDO1 + 1](CanFrame(RPDO1 + 1, pack_target(word, 0, 0)))
        self.drive.hears[SYNC](CanFrame(SYNC, b""))

    def go(self, seconds):
        """Let time pass; return the longest way that the motor was led."""
        for _ in range(round(seconds / 0.002)):
            self.drive.control(0.002)
            if self.motor.kp:
                self.motor.angle, self.motor.speed = self.motor.target, self.motor.slope
        return self.motor.angle


@pytest.mark.parametrize(
    ("option", "after", "angle"),
    [
        (0, DriveState.SWITCH_ON_DISABLED, 0.0),
        (1, DriveState.SWITCH_ON_DISABLED, 0.1),
        (2, DriveState.SWITCH_ON_DISABLED, 0.02),
        (3, DriveState.SWITCH_ON_DISABLED, 0.0),
        (4, DriveState.SWITCH_ON_DISABLED, 0.0),
        (5, DriveState.QUICK_STOP, 0.1),
        (6, DriveState.QUICK_STOP, 0.02),
        (7, DriveState.QUICK_STOP, 0.0),
    ],
)
def test_a_quick_stop_brakes_and_then_lets_go_or_holds(dog, option, after, angle):
    turning = Turning(dog, x605A=option)
    turning.tell(QUICK_STOP)
    assert turning.go(0.5) == pytest.approx(angle, abs=0.01)
    assert turning.drive.state is after
    assert bool(turning.motor.kp) == (after is DriveState.QUICK_STOP)
    turning.tell(ENABLE)
    assert (turning.drive.state is DriveState.ENABLED) == (after is DriveState.QUICK_STOP)
    turning.tell(VOLTAGE_OFF)
    turning.go(0.01)
    assert turning.motor.kp == turning.motor.kd == 0.0


@pytest.mark.parametrize(("option", "angle"), [(0, 0.0), (1, 0.1)])
def test_disabling_operation_lets_go_at_once_or_brakes_before(dog, option, angle):
    turning = Turning(dog, x605C=option)
    turning.tell(DISABLE_OPERATION)
    assert turning.go(0.5) == pytest.approx(angle, abs=0.01)
    assert (turning.drive.state, turning.motor.kp) == (DriveState.SWITCHED_ON, 0.0)


@pytest.mark.parametrize(("option", "angle"), [(0, 0.0), (1, 0.1), (2, 0.02), (3, 0.0)])
def test_a_fault_brakes_or_not_and_always_ends_without_torque(dog, option, angle):
    turning = Turning(dog, x605E=option)
    turning.drive.fail("overcurrent")
    assert turning.go(0.5) == pytest.approx(angle, abs=0.01)
    assert (turning.drive.state, turning.motor.kp) == (DriveState.FAULT, 0.0)


@pytest.mark.parametrize(
    ("option", "after"),
    [
        (0, DriveState.ENABLED),
        (1, DriveState.FAULT),
        (2, DriveState.SWITCH_ON_DISABLED),
        (3, DriveState.QUICK_STOP),
    ],
)
def test_a_silent_master_is_answered_as_6007h_says(dog, option, after):
    turning = Turning(dog, x6007=option, x605A=6)
    turning.drive.hears[0x77F](CanFrame(0x77F, b"\x05"))
    turning.go(0.3)
    assert turning.drive.state is after
    assert turning.drive.nmt == 0x7F  # 1029h:1 is 0, as drives are delivered
