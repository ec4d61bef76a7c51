"""Random walk of a simulated robot: no permitted command may make it fall."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Literal

import msgspec

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.robot.parts import Pace
from fleet_quadruped.sim.rig import Rig

_SHORTEST, _LONGEST = 0.3, 5.0  # s: duration of one velocity


def velocities(pace: Pace, rng: random.Random) -> Iterator[Twist]:
    """Yield an endless series of velocities: random ones, limits, reversals of the last one, zero."""
    last = Twist()
    while True:
        kind = rng.choice(("any", "any", "corner", "reverse", "stop"))
        if kind == "reverse":
            last = Twist(-last.x, -last.y, -last.turn)
        elif kind == "stop":
            last = Twist()
        else:
            x, y, turn = (rng.uniform(-1, 1) if kind == "any" else rng.choice((-1, 1)) for _ in range(3))
            last = Twist(x * pace.speed, y * pace.strafe, turn * pace.turn)
        yield last


def wander(rig: Rig, gait: Literal["trot", "walk"], rng: random.Random, seconds: float) -> float:
    """Change the velocity of a standing robot at random, in mid-stride; return its largest tilt, rad.

    Ends early if the robot has stopped itself.
    """
    rig.order = msgspec.structs.replace(rig.order, gait=gait)
    pace = rig.dog.gait.walk if gait == "walk" else rig.dog.gait
    given, until, worst = velocities(pace, rng), rig.sim.time + seconds, 0.0
    while not rig.fault and rig.sim.time < until:
        rig.go(rng.uniform(_SHORTEST, _LONGEST), next(given))
        worst = max(worst, rig.tilt)
    return worst
