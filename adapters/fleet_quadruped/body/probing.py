"""Small moves of ``fleet can check --move``: the trunk shifts and tilts while the feet stay in place.

The feet's positions compared with the IMU give the sign and offset of each joint.
"""

from __future__ import annotations

from typing import NamedTuple

from fleet import quaternion_from_euler
from fleet_quadruped.body.legs import LegPoint
from fleet_quadruped.body.motion import PostureMotion, Segment
from fleet_quadruped.body.vector_rotation import to_body
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import Twelve

FOLD_TIME, RISE_TIME, MOVE_TIME, HOLD_TIME = 1.5, 2.0, 0.8, 0.4  # s
_SHIFT = 0.11  # of the leg's length
_TILT, _TURN = 0.18, 0.22  # rad


class TrunkPose(NamedTuple):
    """Position of the trunk relative to its crouch: m and rad; ``up`` is the height of the hips."""

    up: float
    x: float = 0.0
    y: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


def lean_tests(dog: DogDescription) -> tuple[TrunkPose, ...]:
    """Return the trunk positions of the check, the lowest first."""
    gait, shift = dog.gait, _SHIFT * (dog.geometry.thigh + dog.geometry.calf)
    low = gait.lowest
    middle = (low + gait.height) / 2
    offsets = [{"x": shift}, {"y": shift}, {"roll": _TILT}, {"pitch": _TILT}, {"yaw": _TURN}]
    there = [
        TrunkPose(middle, **{name: side * value})
        for offset in offsets
        for name, value in offset.items()
        for side in (1, -1)
    ]
    return (TrunkPose(low), TrunkPose(middle), *there, TrunkPose(gait.height), TrunkPose(low))


def look_times(dog: DogDescription) -> tuple[float, ...]:
    """Return the times (s from the start) at which the trunk has come to rest at each of ``lean_tests``."""
    first = FOLD_TIME + RISE_TIME + HOLD_TIME
    return tuple(first + number * (MOVE_TIME + HOLD_TIME) for number in range(len(lean_tests(dog))))


def probing_motion(dog: DogDescription, start: Twelve) -> PostureMotion:
    """Fold slowly, crouch, and move the trunk to each of ``lean_tests``."""
    fold = dog.posture(dog.poses.fold)
    first, *others = lean_tests(dog)
    segments = [
        Segment(FOLD_TIME, fold),
        Segment(RISE_TIME, lean_angles(dog, first)),
        Segment(HOLD_TIME, lean_angles(dog, first)),
    ]
    before = first
    for lean in others:
        segments += [_move(dog, before, lean), Segment(HOLD_TIME, lean_angles(dog, lean))]
        before = lean
    return PostureMotion(start, segments)


def _move(dog: DogDescription, before: TrunkPose, after: TrunkPose) -> Segment:
    """Return the path of the trunk from one position to another."""

    def path(share: float) -> Twelve:
        return lean_angles(dog, TrunkPose(*(a + (b - a) * share for a, b in zip(before, after, strict=True))))

    return Segment(MOVE_TIME, lean_angles(dog, after), path)


def lean_angles(dog: DogDescription, lean: TrunkPose) -> Twelve:
    """Return the joint angles for a trunk position, with the feet below the hips of a level trunk."""
    rotation = quaternion_from_euler(lean.roll, lean.pitch, lean.yaw)
    angles: list[float] = []
    for leg in dog.legs:
        stands: LegPoint = (
            leg.x - lean.x,
            leg.y + leg.side * leg.offset - lean.y,
            dog.geometry.foot_radius - lean.up,
        )
        x, y, z = to_body(rotation, stands)
        angles += leg.angles((x - leg.x, y - leg.y, z))
    return tuple(angles)
