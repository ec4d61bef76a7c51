"""Random search in MuJoCo for the poses with which a robot rolls onto its feet.

    python -m fleet_quadruped.sim.tune robots/rex.yaml

The poses are specific to one geometry; they are printed as YAML for the description.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections.abc import Sequence
from pathlib import Path

from fleet import Quaternion, quaternion_from_euler
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.robot.description import DogDescription, load_description
from fleet_quadruped.robot.parts import LegPose
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig

_STEP = 0.01  # s
_HEARD = 0.1  # s until all drives have sent feedback
_STANDING_UP = frozenset({BodyMode.ENABLING, BodyMode.RECOVERING, BodyMode.RISING})


def random_turn(rng: random.Random) -> Quaternion:
    """Return a uniformly distributed random orientation."""
    return Quaternion(*(rng.gauss(0, 1) for _ in range(4))).normalized()


def drop(world: MujocoWorld, turn: Quaternion, seconds: float = 1.0) -> None:
    """Drop the limp robot from half a metre and let it come to rest."""
    for motor in world.motors:
        motor.kp, motor.kd = 0.0, 1.0
    world.put(turn, 0.5)
    for _ in range(round(seconds / _STEP)):
        world.step(_STEP)
    world.measure()


def tries_needed(dog: DogDescription, turn: Quaternion, most: int = 3) -> int | None:
    """Return the number of rolls until a dropped robot stands; None if more than ``most`` would be needed.

    The real controller does it over simulated drives, with its monitor, its limits, and colliding legs.
    """
    world = MujocoWorld(dog)
    drop(world, turn)
    rig = Rig(dog, world)
    rig.go(_HEARD)
    if rig.request(BodyRequest.RECOVER):
        return None
    body = rig.controller.body
    while rig.mode in _STANDING_UP and body.recovery.tries <= most:
        rig.cycle()
    return body.recovery.tries if rig.mode is BodyMode.STANDING else None


def with_roll(dog: DogDescription, near: LegPose, far: LegPose) -> DogDescription:
    """Return the description with these roll poses."""
    return dog.model_copy(update={"poses": dog.poses.model_copy(update={"roll_near": near, "roll_far": far})})


def _random_pose(dog: DogDescription, rng: random.Random) -> LegPose:
    margin = dog.safety.margin
    ranges = (dog.actuators[part].limits for part in ("abad", "hip", "knee"))
    angles = [round(rng.uniform(low + margin, high - margin), 3) for low, high in ranges]
    return LegPose(abad=angles[0], hip=angles[1], knee=angles[2])


def search(dog: DogDescription, rounds: int, seed: int = 1) -> tuple[LegPose, LegPose, int]:
    """Return the best roll poses of ``rounds`` tries, and the number of trial orientations they master."""
    rng = random.Random(seed)  # noqa: S311 - reproducible
    trials = [quaternion_from_euler(roll, 0.0, 0.0) for roll in (math.pi, 1.6, -1.6, 2.5, -2.6)]
    trials += [random_turn(rng) for _ in range(7)]
    best: tuple[LegPose, LegPose, int] | None = None
    for _ in range(rounds):
        near, far = _random_pose(dog, rng), _random_pose(dog, rng)
        score = _score(with_roll(dog, near, far), trials, best[2] if best else 0)
        if best is None or score > best[2]:
            best = near, far, score
        if best[2] == len(trials):
            break
    assert best is not None
    return best


def _score(dog: DogDescription, trials: Sequence[Quaternion], enough: int) -> int:
    """Count the mastered orientations; stop early if the best so far cannot be beaten."""
    mastered = 0
    for number, turn in enumerate(trials):
        mastered += tries_needed(dog, turn, most=2) is not None
        if not mastered:  # the first trial is the hardest: on its back
            return 0
        if mastered + len(trials) - number - 1 <= enough:
            break
    return mastered


def main(arguments: list[str]) -> int:
    """Search and print the poses."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("body", type=Path, help="the dog's description")
    parser.add_argument("--rounds", type=int, default=400, help="poses to try")
    given = parser.parse_args(arguments)
    near, far, score = search(load_description(given.body), given.rounds)
    for name, pose in (("roll_near", near), ("roll_far", far)):
        sys.stdout.write(f"  {name}: {{abad: {pose.abad}, hip: {pose.hip}, knee: {pose.knee}}}\n")
    sys.stdout.write(f"  # {score} of 12 trial orientations\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
