"""A simulated dog in physics: speeds, tilt, falls, emergency stops, recovery, cost. Lock-step, so repeatable.

python -m bench quadruped
"""

from __future__ import annotations

import math
import random
import statistics
import time

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.robot.description import EXAMPLE, Description, load_description
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from fleet_quadruped.sim.tune import random_turn, tries_needed

SEEDS = 10  # each with another friction and other lost frames
COMMANDS = {
    "forward 0.6 m/s": Twist(0.6),
    "sideways 0.2 m/s": Twist(0, 0.2),
    "turn 0.8 rad/s": Twist(0, 0, 0.8),
}


def standing(dog: Description, seed: int = 1, loss: float = 0.0) -> Rig:
    rig = Rig(dog, MujocoWorld(dog, friction=0.6 + 0.04 * seed), seed=seed)
    rig.stand()
    if loss:
        rig.sim.fault("loss", loss)
    return rig


def walk(rig: Rig, twist: Twist) -> tuple[float, float]:
    """Return the true speed (m/s or rad/s) and the greatest tilt (degrees)."""
    rig.go(1.5, twist)
    start, heading = rig.sim.world.place(), rig.sim.world.imu().rotation.yaw
    rig.go(2.5, twist)
    end, turned = rig.sim.world.place(), rig.sim.world.imu().rotation.yaw
    if twist.turn:
        return math.remainder(turned - heading, math.tau) / 2.5, math.degrees(rig.tilt)
    return math.dist(start[:2], end[:2]) / 2.5, math.degrees(rig.tilt)


def gaits(dog: Description, seeds: int) -> None:
    for loss in (0.0, 0.05):
        rigs = [standing(dog, seed, loss) for seed in range(1, seeds + 1)]
        for name, twist in COMMANDS.items():
            seen = [walk(rig, twist) for rig in rigs]
            speeds, tilts = [speed for speed, _ in seen], [tilt for _, tilt in seen]
            falls = sum(bool(rig.fault) for rig in rigs)
            print(
                f"{dog.drive.protocol:7} loss {loss:4.0%} {name:17} got {statistics.mean(speeds):.3f} "
                f"({min(speeds):.3f} to {max(speeds):.3f}), tilt {max(tilts):.1f} deg, stops {falls}/{seeds}"
            )
            for rig in rigs:
                rig.go(1.5)


def stops(dog: Description) -> None:
    drops = []
    for phase in range(8):
        rig = standing(dog)
        rig.go(1.5 + phase * dog.gait.period / 8, Twist(0.5))
        falling: list[float] = []
        rig.watch = lambda rig=rig, falling=falling: falling.append(rig.sim.world.fall_speed)
        rig.emergency()
        rig.go(2.0)
        drops.append(max(falling))
    print(f"{dog.drive.protocol:7} emergency stop in 8 phases of a trot: drop {max(drops):.2f} m/s at worst")


def recoveries(dog: Description, count: int = 60) -> None:
    chance = random.Random(99)
    tries = [tries_needed(dog, random_turn(chance), most=5) for _ in range(count)]
    up = sum(one is not None for one in tries)
    rolls = {number: tries.count(number) for number in range(6) if number in tries}
    print(f"recovery: {up}/{count}, by rolls needed: {rolls}")


def cost(dog: Description) -> None:
    rig = standing(dog)
    begun = time.process_time()
    rig.go(5.0, Twist(0.5))
    share = (time.process_time() - begun) / 5
    print(f"{dog.drive.protocol:7} whole stack in lock-step: {share:.1%} of a core a dog")


def run() -> None:
    dog = load_description(EXAMPLE)
    drive = dog.drive.model_copy(update={"protocol": "mit", "profile": "damiao-8006"})
    for each in (dog, dog.model_copy(update={"drive": drive})):
        gaits(each, SEEDS)
        stops(each)
        cost(each)
    recoveries(dog)
