"""Robots built slightly differently from their description, and wrong descriptions of them.

For tests and measurements of ``fleet can check --move``.
"""

from __future__ import annotations

import random

from fleet import Quaternion, quaternion_from_euler
from fleet.testing.clock import ManualClock
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.check_moves import CheckMoves
from fleet_quadruped.commissioning import at_rest, problems
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig

_OFFSET, _LENGTH, _MASS, _MOUNT = 0.02, 0.01, 0.05, 0.015  # largest errors: rad; shares; rad
_FRICTION = (0.6, 1.0)
_LONGEST = 40.0  # s of a check


class BuiltWorld(MujocoWorld):
    """A world with physics whose IMU is mounted slightly tilted."""

    mount = Quaternion()

    def imu(self) -> MeasuredImu:
        """Return the measurement of this IMU."""
        true = super().imu()
        return true._replace(rotation=_product(true.rotation, self.mount))


def as_built(dog: DogDescription, seed: int) -> tuple[DogDescription, BuiltWorld]:
    """Return a robot with small manufacturing errors, and its world with a random friction."""
    rng = random.Random(seed)
    joints = {
        name: wiring.model_copy(update={"offset": wiring.offset + rng.uniform(-_OFFSET, _OFFSET)})
        for name, wiring in dog.joints.items()
    }
    lengths = ("hip_x", "hip_y", "abad_offset", "thigh", "calf", "foot_radius")
    shape = {name: getattr(dog.geometry, name) * (1 + rng.uniform(-_LENGTH, _LENGTH)) for name in lengths}
    mass = dog.robot.mass * (1 + rng.uniform(-_MASS, _MASS))
    built = _changed(
        dog,
        joints=joints,
        geometry=dog.geometry.model_copy(update=shape),
        robot=dog.robot.model_copy(update={"mass": mass}),
    )
    world = BuiltWorld(built, friction=rng.uniform(*_FRICTION))
    world.mount = quaternion_from_euler(rng.uniform(-_MOUNT, _MOUNT), rng.uniform(-_MOUNT, _MOUNT), 0.0)
    return built, world


def with_offset(dog: DogDescription, name: str, offset: float) -> DogDescription:
    """Return the description with an error in one joint's offset, rad."""
    wiring = dog.joints[name]
    return _changed(
        dog, joints={**dog.joints, name: wiring.model_copy(update={"offset": wiring.offset + offset})}
    )


def with_sign(dog: DogDescription, name: str, *, calibrated: bool) -> DogDescription:
    """Return the description with a wrong sign; ``calibrated``: its offset was measured with that sign."""
    wiring = dog.joints[name]
    fold = dog.posture(dog.poses.fold)[JOINTS.index(name)]
    offset = wiring.offset + (2 * wiring.sign * fold if calibrated else 0.0)
    wrong = wiring.model_copy(update={"sign": -wiring.sign, "offset": offset})
    return _changed(dog, joints={**dog.joints, name: wrong})


def checked(dog: DogDescription, built: DogDescription, world: MujocoWorld) -> list[str]:
    """Return the result of a check with moves of a robot described as ``dog`` and built as ``built``."""
    rig = Rig(dog, world, real=built)
    rig.go(0.1)
    found = at_rest(dog, rig.state().angles)
    if found:
        return found
    clock = ManualClock()
    moves = CheckMoves(dog, clock, lambda: False)
    while not rig.order.leave and rig.sim.time < _LONGEST:
        rig.order = moves.order()
        rig.cycle()
        clock.advance(dog.dt)
        moves.put(rig.state())
    if rig.mode is not BodyMode.OFF:
        raise AssertionError(f"the check has no end: it is {rig.mode.value}")
    return problems(dog, moves.looks, moves.ended)


def _changed(dog: DogDescription, **sections: object) -> DogDescription:
    """Return a description with some sections replaced, validated again."""
    return DogDescription.model_validate(dog.model_copy(update=sections).model_dump())


def _product(one: Quaternion, two: Quaternion) -> Quaternion:
    """Return the rotation ``two`` followed by ``one``."""
    return Quaternion(
        one.w * two.w - one.x * two.x - one.y * two.y - one.z * two.z,
        one.w * two.x + one.x * two.w + one.y * two.z - one.z * two.y,
        one.w * two.y - one.x * two.z + one.y * two.w + one.z * two.x,
        one.w * two.z + one.x * two.y - one.y * two.x + one.z * two.w,
    )
