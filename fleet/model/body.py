"""Parts of a robot's body, for drawings of it."""

from __future__ import annotations

import msgspec

from fleet.model.geometry import Vector3


class BodyPart(msgspec.Struct, frozen=True, omit_defaults=True):
    """A rigid part of a robot, metres.

    Its frame is at ``at`` in the frame of ``parent`` (empty: the robot's own frame, x forward, y left, z up),
    rotated about ``axis`` by the angle of ``joint``, named as in the robot's JointReports (empty: it does not
    rotate). The part is a rod from the origin of its frame to ``end``, or a box of ``size`` around that
    origin.
    """

    name: str
    parent: str = ""
    at: Vector3 = Vector3()
    joint: str = ""
    axis: Vector3 = Vector3()
    end: Vector3 | None = None
    size: Vector3 | None = None
