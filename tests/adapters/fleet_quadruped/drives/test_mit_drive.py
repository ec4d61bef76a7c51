from fleet_quadruped.can.frame import Frame
from fleet_quadruped.drives import drives_of
from fleet_quadruped.sim.lockstep import lockstep


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
        return self._bus.receive(0.0) if self._looks % 5 == 0 else [Frame(0x110, bytes(8))]


def test_motors_are_waited_for_while_others_speak(mit_dog):
    _, buses = lockstep(mit_dog)
    drives_of(mit_dog, {"a": Chatty(buses["a"])}).configure()  # raises LinkLost for one that is not heard
