"""Gait patterns: timing of the foot lifts in trot and walk."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fleet_quadruped.body.legs import DogLeg
from fleet_quadruped.robot.parts import Gait

_WALK_DUTY = 0.84  # 0.16 in the air for each of four feet, the rest for swaying
_WALK_START = 0.75  # of a cycle: the body has swayed before the first foot leaves the ground
_WALK_REACH = 1.3  # times half of the longest step


class Pattern(NamedTuple):
    """Timing of FL, FR, RL, RR: each foot is lifted at the share ``duty`` of its own cycle.

    ``start``: phase at which the gait begins. ``sway``: how far the centre of pressure moves towards the
    standing feet of a side, as a share of the distance: to the right in the first half of a cycle. With a
    sway, no foot is lifted before a whole half cycle begins. ``reach``: how far (m) forward and sideways of
    its neutral position a foot may be left behind.
    """

    period: float
    duty: float
    phases: tuple[float, float, float, float]
    start: float
    sway: float = 0.0
    reach: tuple[float, float] | None = None


def trot(gait: Gait) -> Pattern:
    """Return the trot: fast, two feet on the ground."""
    return Pattern(gait.period, gait.duty, (0.0, 0.5, 0.5, 0.0), 0.5)


def walk(gait: Gait, legs: Sequence[DogLeg]) -> Pattern:
    """Return the walk: slow, three feet on the ground, statically stable."""
    lifts = (0.26, 0.76, 0.08, 0.58)
    front_left, front_right, rear_left, rear_right = (_WALK_DUTY - lift for lift in lifts)
    phases = (front_left, front_right, rear_left, rear_right)
    pace, most = gait.walk, _WALK_REACH * gait.walk.period * _WALK_DUTY / 2
    aside = max(pace.strafe, pace.turn * max(leg.x for leg in legs))
    reach = (most * pace.speed, most * aside)
    return Pattern(pace.period, _WALK_DUTY, phases, _WALK_START, pace.sway, reach)
