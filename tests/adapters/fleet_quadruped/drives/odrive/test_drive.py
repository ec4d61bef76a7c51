"""What only ODrives do: gains that may be lost, a watchdog that positions feed, states of their own."""

import pytest

from fleet.link.canbus.frame import CanFrame
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import lockstep
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import standing_dog


@pytest.fixture
def odrives(dogs):
    return dogs["odrive"]


def test_a_dog_that_is_damped_is_fed_until_it_lies(odrives):
    rig = standing_dog(odrives)
    rig.emergency()
    for _ in range(150):
        rig.cycle()
        assert all(drive.state == State.CLOSED_LOOP for drive in rig.sim.drives)
        assert not any(drive.errors for drive in rig.sim.drives)


@pytest.mark.parametrize("seed", range(4))
def test_drives_whose_frames_are_lost_stand_with_their_gains_all_the_same(odrives, seed):
    rig = Rig(odrives, seed=seed)
    rig.sim.fault("loss", 0.1)
    rig.stand()
    rig.sim.clear("loss")
    rig.go(0.3, Twist(0.2))
    kinds = [joint.kind for joint in odrives.all_joints]
    assert [motor.kp for motor in rig.sim.world.motors] == pytest.approx([kind.kp for kind in kinds])
    assert [motor.kd for motor in rig.sim.world.motors] == pytest.approx([kind.kd for kind in kinds])


def test_a_drive_in_a_state_of_its_own_is_not_trusted(odrives):
    rig = Rig(odrives)
    rig.go(0.1)
    calibrating = wire.pack_heartbeat(0, 3)  # it turns its motor
    drives = rig.controller.drives
    drives.handle_frame("a", CanFrame(wire.identifier(8, OdriveCommand.HEARTBEAT), calibrating), rig.sim.time)
    feedback = drives.feedback(rig.sim.time)
    assert feedback.powers[7] is Power.FAULT
    assert feedback.faults[7] == "id 8 is in state 3, in which it moves its motor by itself"


def test_a_drive_whose_heartbeat_does_not_come_is_not_trusted(odrives):
    rig = standing_dog(odrives)
    drive = rig.sim.drives[7]
    drive._ANSWERS = {OdriveCommand.ESTIMATES: type(drive)._estimates}
    rig.go(0.5)
    assert rig.mode is BodyMode.DAMPED
    assert rig.fault.startswith("RL_hip: no heartbeat (command 01h) from id 8 for 0.3")


def test_nothing_is_enabled_before_its_gains_are_zero(odrives):
    sim, buses = lockstep(odrives)
    drives = drives_of(odrives, buses)
    drives.configure()
    order = []
    for cycle in range(6):
        drives.begin_cycle(0.01 * cycle)
        buses["a"].sent.clear()
        drives.enable()
        order += [wire.split(frame.id)[1] for frame in buses["a"].sent if wire.split(frame.id)[0] == 1]
        for frame in buses["a"].receive(0.0):
            drives.handle_frame("a", frame, 0.01 * cycle)
    assert (
        order.index(OdriveCommand.POS_GAIN)
        < order.index(OdriveCommand.VEL_GAINS)
        < order.index(OdriveCommand.STATE)
    )
    assert set(drives.feedback(0.06).powers) == {Power.ENABLED}
    sim.advance(0.002)
    assert all(motor.kp == motor.kd == 0 for motor in sim.world.motors)


def test_a_position_on_the_bus_is_returned_as_its_joints_target(odrives):
    _, buses = lockstep(odrives)
    drives, joint = drives_of(odrives, buses), odrives.all_joints[4]
    frame = CanFrame(wire.identifier(5, OdriveCommand.INPUT_POS), wire.pack_input(joint.motor(0.7), 0.0, 0.0))
    found, angle = drives.target("a", frame)
    assert (found.name, angle) == (joint.name, pytest.approx(0.7))
