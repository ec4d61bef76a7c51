"""Commands to a robot that is outside its fence, or may be: only what leads back inside, or down.

See docs/adr/0030-back-into-the-fence.md. Goals and velocities are judged by the fence itself.
"""

from __future__ import annotations

import math

from fleet.commands import CommandSpec
from fleet.host.robot.fence_keeper import FenceKeeper
from fleet.host.robot.robot_place import RobotPlace
from fleet.model.command import Command
from fleet.model.geometry import Vector3

CLIMBS = {"takeoff": ("altitude", 0), "ascend": ("distance", 1), "descend": ("distance", -1)}
"""Vertical commands: the parameter with the distance, and its sign (0: height above home)."""

LANDINGS = frozenset({"land", "return_to_home"})
"""Commands that lead down, which is safe: they are never refused because of the fence, and for a flying robot
not because of another robot, which is only reported."""

ALLOWED_OUTSIDE = "possible are stop, land, return_to_home and motion that leads back inside"
"""Ends a refusal of a robot outside its fence: what a person can do."""


def stays_in_place(request: Command, spec: CommandSpec | None) -> bool:
    """Return whether a command takes a robot to no other place, or only makes it safer.

    ``spec`` is None for a command of the host itself.
    """
    return spec is None or not spec.moves or spec.safe or spec.in_place or request.name in LANDINGS


def vertical_motion(request: Command, place: RobotPlace, default: float) -> Vector3 | None:
    """Return the way of one of ``CLIMBS`` (``default``: m of a take-off without a height).

    None for an unknown height, and for parameters that the command itself refuses.
    """
    pose, home = place.fresh(), place.home_point()
    if pose is None:
        return None
    field, sign = CLIMBS[request.name]
    metres = request.data.get(field, default)
    if not isinstance(metres, int | float) or not math.isfinite(metres):
        return None
    return Vector3(0.0, 0.0, sign * abs(metres) if sign else home.z + metres - pose.position.z)


def outside_trouble(fencing: FenceKeeper, place: RobotPlace, rise: Vector3 | None) -> str | None:
    """Return why a robot may not move to another place now; None when it may.

    ``rise``: its way is straight up or down, which may lead back below the ceiling; None: it is unknown.
    """
    out, pose = fencing.breached, place.fresh()
    if not out:
        return None
    if rise is not None and pose is not None and fencing.fence is not None:
        leads_back = not fencing.route_trouble(pose.position, (pose.position + rise,))
        return None if leads_back else f"{out}; {ALLOWED_OUTSIDE}"
    return f"{out}; {ALLOWED_OUTSIDE}"
