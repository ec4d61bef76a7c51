"""What only moteus does: its gains are shares, its time-out is latched, its place may refer to nothing."""

import pytest

from fleet.errors import LinkRefused
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import lockstep
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig


@pytest.fixture
def servos(dogs):
    return dogs["moteus"]


def refused(dog, change):
    sim, buses = lockstep(dog)
    change(sim.drives[7])
    with pytest.raises(LinkRefused) as caught:
        drives_of(dog, buses).configure()
    return str(caught.value)


def test_stiffness_and_damping_are_those_of_the_description(servos):
    rig = Rig(servos)
    rig.stand()
    kinds = [joint.kind for joint in servos.all_joints]
    assert [motor.kp for motor in rig.sim.world.motors] == pytest.approx(
        [kind.kp for kind in kinds], rel=1e-3
    )
    assert [motor.kd for motor in rig.sim.world.motors] == pytest.approx(
        [kind.kd for kind in kinds], rel=1e-3
    )


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("servo.pid_position.kp", 4.0, "kp is 4, wanted 376.991 or more (N m/turn)"),
        ("servo.pid_position.kd", 1.0, "kd is 1, wanted 25.1327 or more (N m s/turn)"),
        ("servo.pid_position.kd", 20.0, "kd is 20, wanted 25.1327 or more (N m s/turn)"),
        ("servo.pid_position.ki", 0.5, "ki is 0.5, wanted 0"),
    ],
)
def test_a_servo_that_cannot_have_the_gains_is_refused(servos, name, value, expected):
    assert refused(servos, lambda drive: drive.config.update({name: value})).endswith(expected)


def test_a_place_that_refers_to_nothing_is_refused(servos):
    refusal = refused(servos, lambda drive: setattr(drive, "home", wire.REFERS_TO_NOTHING))
    assert refusal == "RL_hip: its position has no reference (register 00Ch is 0): home it"


def test_a_place_that_refers_to_the_rotor_is_refused_behind_a_gear(servos):
    tree = servos.model_dump(by_alias=True)
    tree["actuators"]["hip"]["ratio"] = 6
    geared = type(servos).model_validate(tree)
    refusal = refused(geared, lambda drive: setattr(drive, "home", wire.REFERS_TO_ROTOR))
    assert refusal.startswith("RL_hip: its position refers to the rotor (register 00Ch is 1)")
    sim, buses = lockstep(servos)
    for drive in sim.drives:
        drive.home = wire.REFERS_TO_ROTOR
    drives_of(servos, buses).configure()


def test_servos_whose_controller_dies_damp_and_are_off_only_when_they_are_switched_off(servos):
    rig = Rig(servos, MujocoWorld(servos))
    rig.stand()
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
    rig = Rig(servos)
    rig.stand()
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
