"""What only moteus does: its gains are shares, its time-out is latched, it damps in a mode of its own."""

import pytest

from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import lockstep
from tests.adapters.fleet_quadruped.copies import standing_dog, standing_in_physics


@pytest.fixture
def servos(dogs):
    return dogs["moteus"]


def test_stiffness_and_damping_are_those_of_the_description(servos):
    rig = standing_dog(servos)
    kinds = [joint.kind for joint in servos.all_joints]
    assert [motor.kp for motor in rig.sim.world.motors] == pytest.approx(
        [kind.kp for kind in kinds], rel=1e-3
    )
    assert [motor.kd for motor in rig.sim.world.motors] == pytest.approx(
        [kind.kd for kind in kinds], rel=1e-3
    )


def test_servos_whose_controller_dies_damp_and_are_off_only_when_they_are_switched_off(servos):
    rig = standing_in_physics(servos)
    drop = 0.0
    for _ in range(150):
        rig.sim.advance(0.01)
        drop = max(drop, rig.sim.world.fall_speed)
    assert {drive.mode for drive in rig.sim.drives} == {wire.TIMED_OUT}
    assert all(motor.kp == 0 and motor.kd > 2.9 for motor in rig.sim.world.motors)
    assert drop < 0.5
    rig.reconnect()
    rig.go(0.05)
    assert rig.mode is BodyMode.DAMPED
    assert set(rig.controller.drives.feedback(rig.sim.time).powers) == {Power.STOPPING}
    rig.go(3.0)
    assert rig.mode is BodyMode.OFF
    assert {drive.mode for drive in rig.sim.drives} == {wire.STOPPED}
    rig.stand()


def test_damping_is_a_mode_of_its_own_because_position_mode_would_not_damp(servos):
    rig = standing_dog(servos)
    rig.emergency()
    rig.go(0.05)
    assert {drive.mode for drive in rig.sim.drives} == {wire.DAMPS}
    assert [motor.kd for motor in rig.sim.world.motors] == pytest.approx([servos.safety.kd] * 12, rel=1e-3)


def test_a_jog_is_held_to_its_torque_by_the_servo_itself(servos):
    _, buses = lockstep(servos)
    drives = drives_of(servos, buses)
    drives.configure()
    drives.limit_torque(1.5)
    buses["a"].sent.clear()
    drives.enable()
    (command,) = [part for part in wire.unpack(buses["a"].sent[0].data) if part.start == wire.COMMAND]
    assert command.values[5] == 1.5
