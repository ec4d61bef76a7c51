import pytest

from fleet.link.canbus.frame import CanFrame
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import Power
from fleet_quadruped.sim.lockstep import lockstep
from fleet_quadruped.sim.rig import Rig


class Chatty:
    """A bus on which an IMU speaks first: the motors' answers come a few looks later."""

    name = "a"

    def __init__(self, bus):
        self._bus = bus
        self._looks = 0

    def send(self, frame):
        self._bus.send(frame)

    def receive(self, wait):
        self._looks += 1
        return self._bus.receive(0.0) if self._looks % 5 == 0 else [CanFrame(0x110, bytes(8))]


def test_motors_are_waited_for_while_others_speak(mit_dog):
    _, buses = lockstep(mit_dog)
    drives_of(mit_dog, {"a": Chatty(buses["a"])}).configure()  # raises LinkLost for one that is not heard


@pytest.mark.parametrize("seed", range(4))
def test_motors_that_say_no_status_are_enabled_though_answers_are_lost(dog, seed):
    drive = dog.drive.model_copy(update={"protocol": "mit", "profile": "tmotor-ak80-9"})
    rig = Rig(dog.model_copy(update={"drive": drive}), seed=seed)
    rig.sim.fault("loss", 0.1)
    rig.stand()


def test_a_motor_that_says_no_status_is_not_enabled_before_it_has_answered(dog):
    drive = dog.drive.model_copy(update={"protocol": "mit", "profile": "tmotor-ak80-9"})
    sim, buses = lockstep(dog.model_copy(update={"drive": drive}))
    drives = drives_of(sim.dog, buses)
    drives.configure()
    sim.fault("mute", 5)
    for cycle in range(50):
        drives.begin_cycle(0.0)
        drives.enable()
        for frame in buses["a"].receive(0.0):
            drives.handle_frame("a", frame, 0.01 * cycle)
    powers = drives.feedback(0.5).powers
    assert [power is Power.ENABLED for power in powers] == [number != 5 for number in range(1, 13)]


def test_motors_that_were_without_power_get_their_watchdog_again(mit_dog):
    sim, buses = lockstep(mit_dog)
    drives = drives_of(mit_dog, buses)
    drives.configure()
    for drive in sim.drives:
        drive.boot()
    drives.configure()  # raises LinkRefused for a watchdog that is not as it was set
