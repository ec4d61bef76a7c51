"""Goals for one or several robots as messages of the ``navigate`` kind; pure.

Several robots sent to one point get positions around it; that needs a ``spacing``.
"""

from __future__ import annotations

import itertools
import math
import uuid
from collections.abc import Sequence

import msgspec

from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, geo_from_world
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement
from fleet.model.spread import arranged, grid_positions
from fleet.model.state import RobotState

ONE_FRAME = 0.05  # m and rad by which two world frames may differ and still count as one


class GotoTarget(msgspec.Struct, frozen=True):
    """Target of a goal: metres in ``frame`` (world: each robot's own, site), or degrees (geo).

    ``via`` has the waypoints before the target, each of two or three numbers. ``named``: the place of
    fleet.yaml, None for a plain point.
    """

    x: float
    y: float
    z: float | None = None
    frame: str = "world"
    yaw: float | None = None
    speed: float | None = None
    spacing: float | None = None
    via: tuple[tuple[float, ...], ...] = ()
    named: Place | None = None


def target_of(place: Place) -> GotoTarget:
    """Return the target for a place of fleet.yaml."""
    x, y, *z = place.at
    frame = "geo" if place.frame == "geodetic" else "site"
    return GotoTarget(x, y, z[0] if z else None, frame, place.heading, named=place)


def goals(aim: GotoTarget, robots: list[RobotState]) -> list[dict[str, object]]:
    """Return each robot's message; raises Refused for one point for several, and without a common frame."""
    _require_one_frame(aim, robots)
    if aim.named is not None and (trouble := aim.named.trouble([Vector3()] * len(robots))):
        raise Refused(trouble)
    if len(robots) == 1:
        return [_message(aim, robots[0], Vector3())]
    if aim.via:
        raise Refused(f"one path for {len(robots)} robots: they would meet on it", hint="send each its own")
    if aim.spacing is None:
        raise Refused(
            f"one point for {len(robots)} robots: they would meet there",
            hint="--spacing 5 spreads them around it, 5 m from each other",
        )
    sites = [robot.site for robot in robots if robot.site is not None]
    steps: Sequence[Vector3] = grid_positions(len(robots), aim.spacing)
    if len(sites) == len(robots):
        steps = arranged(sites, _centre(aim, robots[0], sites), aim.spacing)
    if aim.named is not None and (trouble := aim.named.trouble(steps)):
        raise Refused(trouble, hint="a smaller --spacing, or fewer robots")
    return [_message(aim, robot, step) for robot, step in zip(robots, steps, strict=True)]


def _centre(aim: GotoTarget, robot: RobotState, sites: Sequence[Vector3]) -> Vector3:
    """Return the target in the site's frame; the middle of the robots for a target on Earth."""
    if aim.frame == "geo" or robot.placement is None:
        return sum(sites, Vector3()).scaled(1 / len(sites))
    place = Vector3(aim.x, aim.y, aim.z or 0.0)
    return place if aim.frame == "site" else robot.placement.to_site(place)


def _require_one_frame(aim: GotoTarget, robots: list[RobotState]) -> None:
    """Raise Refused unless the coordinates mean the same point for all of the robots."""
    if aim.frame == "site":
        lost = ", ".join(robot.name for robot in robots if robot.placement is None)
        if lost:
            raise Refused(f"not placed in the site's frame: {lost}", hint="site: and start: in fleet.yaml")
    if aim.frame != "world":
        return
    for one, other in itertools.pairwise(robots):
        if not _is_one(one.placement, other.placement):
            raise Refused(
                f"{one.name} and {other.name} have no frame in common: X Y Z count from each one's own home",
                hint="say --site or --geo",
            )


def _is_one(one: Placement | None, other: Placement | None) -> bool:
    """Return whether two world frames are the same."""
    if one is None or other is None:
        return False
    return (one.origin - other.origin).norm() <= ONE_FRAME and abs(one.yaw - other.yaw) <= ONE_FRAME


def _message(aim: GotoTarget, robot: RobotState, step: Vector3) -> dict[str, object]:
    """Return the message that sends a robot to the target, offset by ``step``, or along its path."""
    message: dict[str, object] = {"command": "goto", "action_id": uuid.uuid4().hex}
    yaw = aim.yaw
    if yaw is not None and aim.frame == "site" and robot.placement is not None:
        yaw -= robot.placement.yaw
    turned: dict[str, object] = {} if yaw is None else {"yaw": yaw}
    if yaw is not None and aim.frame == "geo":
        turned = {"orientation": {"heading": (90.0 - math.degrees(yaw)) % 360.0}}
    if aim.via:
        last = (aim.x, aim.y) if aim.z is None else (aim.x, aim.y, aim.z)
        *via, end = (_place(aim.frame, place, robot, step) for place in (*aim.via, last))
        message["waypoints"] = [*via, end | turned]
    else:
        # A place of fleet.yaml without a height must not become a point on the ground: aircraft need one.
        height = () if aim.named is not None and aim.z is None else (aim.z or 0.0,)
        message |= _place(aim.frame, (aim.x, aim.y, *height), robot, step) | turned
    if aim.speed is not None:
        message["constraints"] = {"max_speed_ms": aim.speed}
    return message


def _place(frame: str, place: Sequence[float], robot: RobotState, step: Vector3) -> dict[str, object]:
    """Return one point in the message's fields; an unknown height is omitted."""
    if frame == "geo":
        point = geo_from_world(GeoOrigin(place[0], place[1]), step)
        height = {"altitude": place[2]} if len(place) > 2 else {}
        return {"geodetic_position": {"latitude": point.latitude, "longitude": point.longitude, **height}}
    position = Vector3(*place) + step
    if frame == "site" and robot.placement is not None:
        position = robot.placement.to_world(position)
    return {"position": [position.x, position.y, position.z][: len(place)]}
