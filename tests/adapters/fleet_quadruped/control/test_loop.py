"""How the loop of a body controller ends."""

import pytest

from fleet.errors import LinkLost
from fleet.testing.clock import ManualClock
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.control import orders
from fleet_quadruped.control.loop import ControlLoop
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.rig import Rig


@pytest.fixture(params=[("cia402", ""), ("mit", "tmotor-ak80-9-v1.1"), ("mit", "damiao-8006")])
def two_buses(dog, request):
    """Return a walking dog whose right legs are on a bus of their own."""
    tree = dog.model_dump()
    for name, wiring in tree["joints"].items():
        wiring["bus"] = "b" if name[1] == "R" else "a"
    protocol, profile = request.param
    tree["drive"] |= {"protocol": protocol, "profile": profile}
    rig = Rig(DogDescription.model_validate(tree | {"buses": {"a": {}, "b": {}}}))
    rig.stand()
    rig.go(0.6, Twist(0.4))
    return rig


class Orders:
    """An exchange that says what the rig's host says."""

    def __init__(self, rig):
        self._rig = rig

    def order(self):
        return self._rig.order

    def put(self, state: orders.DogState):
        """Nobody reads it."""


def test_drives_on_the_other_bus_give_way_or_brake_when_one_bus_dies(two_buses, monkeypatch):
    rig = two_buses
    monkeypatch.setattr("fleet_quadruped.control.loop.realtime", lambda: False)
    assert rig.mode is BodyMode.WALKING, rig.fault
    rig.buses["a"].cut = True
    with pytest.raises(LinkLost, match="bus 'a' is gone"):
        ControlLoop(rig.controller, rig.buses, Orders(rig), ManualClock()).run()
    rig.sim.advance(0.002)  # long before the drives' own watchdogs, which some do not have
    right = [
        motor
        for joint, motor in zip(rig.dog.all_joints, rig.sim.world.motors, strict=True)
        if joint.bus == "b"
    ]
    assert len(right) == 6
    if rig.dog.drive.protocol == "mit":
        assert all(motor.kp == 0 < motor.kd for motor in right)
    else:  # those on the dead bus do the same by themselves: all four legs hold the dog
        states = {drive.state for drive in rig.sim.drives if drive.joint.bus == "b"}
        assert states == {DriveState.QUICK_STOP}
        assert all(motor.kp > 0 for motor in right)


class Noted:
    """A capture that notes for which faults a file would be written."""

    def __init__(self):
        self.written = []

    def update(self, fault, *, resting):
        if fault and resting:
            self.written.append(fault)
        return ""


def test_what_was_on_the_buses_is_kept_when_one_dies_in_motion(two_buses, monkeypatch):
    rig, noted = two_buses, Noted()
    monkeypatch.setattr("fleet_quadruped.control.loop.realtime", lambda: False)
    rig.buses["a"].cut = True
    with pytest.raises(LinkLost):
        ControlLoop(rig.controller, rig.buses, Orders(rig), ManualClock(), capture=noted).run()
    assert noted.written == ["bus 'a' is gone"]
