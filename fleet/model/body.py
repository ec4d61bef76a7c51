"""The parts of a robot's body, as far as a drawing of it needs them."""

from __future__ import annotations

import msgspec

from fleet.model.geometry import Vector3


class BodyPart(msgspec.Struct, frozen=True, omit_defaults=True):
    """A rigid part of a robot, metres.

    Its frame is at ``at`` in that of ``parent`` (empty: the robot's own frame, x forward, y left, z up), and
    turned about ``axis`` by the angle of ``joint``, as the robot's JointReports name it (empty: it does not
    turn). It is a rod from the origin of its frame to ``end``, or a box of ``size`` around that origin.
    """

    name: str
    parent: str = ""
    at: Vector3 = Vector3()
    joint: str = ""
    axis: Vector3 = Vector3()
    end: Vector3 | None = None
    size: Vector3 | None = None
