"""A joint with its drive, and a bus that keeps what is sent on it."""

import pytest

from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Actuator


class Wire:
    """A bus: ``sent`` frames, and what is ``heard``, look after look."""

    def __init__(self, name="a"):
        self.name, self.sent, self.heard, self.looks = name, [], [], 0

    def send(self, frame):
        self.sent.append(frame)

    def receive(self, wait):
        self.looks += 1
        return self.heard.pop(0) if self.heard else []

    @property
    def data(self):
        """Return the data of the frames sent since the last look."""
        data, self.sent = [frame.data for frame in self.sent], []
        return data


def make_joint(name="FL_knee", *, bus="a", number=3, sign=1, offset=0.0, **kind):
    """Return a joint whose torque is 24 N m, with the rest of its kind as given."""
    basics = {"limits": (-2.0, 2.0), "velocity": 20.0, "torque": 24.0, "kp": 60.0, "kd": 2.0}
    return Joint(name, bus, number, sign, offset, -2.0, 2.0, Actuator(**basics | kind))


@pytest.fixture
def joint_of():
    return make_joint


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def wires():
    return {name: Wire(name) for name in ("a", "b")}
