"""``fleet goto``: sending a robot, or the robots of a group, to a place."""

from __future__ import annotations

import itertools
import math
import uuid
from collections.abc import Sequence
from pathlib import Path

import click
import msgspec

from fleet.cli.completion import PLACE, ROBOT
from fleet.cli.edges import Edges
from fleet.cli.options import reach_option, timeout_option, wait_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.send import ask_each
from fleet.cli.together import at_option
from fleet.config.route import Waypoints, is_name, read_route, route_of
from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, geo_from_world
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement
from fleet.model.spread import arranged, spread
from fleet.model.state import RobotState

ONE_FRAME = 0.05  # m, and rad, by which two worlds may differ and be one


class GotoTarget(msgspec.Struct, frozen=True):
    """Where to go: metres in ``frame`` (world: each robot's own, site), or degrees (geo).

    ``way`` are the places before the last, each of two or three numbers. ``named``: the place of fleet.yaml
    that it is, None for a point that is only said.
    """

    x: float
    y: float
    z: float | None = None
    frame: str = "world"
    yaw: float | None = None
    speed: float | None = None
    spacing: float | None = None
    way: tuple[tuple[float, ...], ...] = ()
    named: Place | None = None


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("robot", type=ROBOT)
@click.argument("places", nargs=-1, metavar="PLACE | X Y [Z] | X,Y[,Z]...", type=PLACE)
@click.option(
    "--path",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Go through the places of this file: CSV, or GeoJSON.",
)
@click.option("--yaw", type=float, help="Heading at the end, radians counter-clockwise from east.")
@click.option("--speed", type=float, help="Speed limit on the way, m/s.")
@click.option(
    "--geo", is_flag=True, help="X and Y are latitude and longitude, Z is metres above the take-off point."
)
@click.option("--site", is_flag=True, help="X Y Z are metres in the site's frame, not in the robot's own.")
@click.option(
    "--spacing",
    type=click.FloatRange(min=0, min_open=True),
    help="Spread the robots of a group around the place, so many metres from each other.",
)
@wait_option
@timeout_option
@at_option
@reach_option
@with_output
def goto(
    out: Output,
    robot: str,
    places: tuple[str, ...],
    *,
    path: Path | None,
    yaw: float | None,
    speed: float | None,
    geo: bool,
    site: bool,
    spacing: float | None,
    wait: bool,
    timeout: float,
    at: float | None,
    file: str | None,
) -> ExitCode:
    """Send ROBOT to PLACE of fleet.yaml, to X Y Z, metres in its world frame, or through several places.

    For example:  fleet goto beast dock-1  or  fleet goto kestrel 10 0 5 --wait

    Several places:  fleet goto kestrel 10,0,5 10,10,5 0,0,5

    The file of --path has a place a line (CSV: x,y[,z], or below a heading latitude,longitude[,altitude]), or
    is GeoJSON: one LineString, or Points in their order. Altitudes count from the take-off point; aircraft
    need one at each place.

    The robots of a group go to places around the one that is said, --spacing metres from each other, as many
    as PLACE has room for. With --at all are prepared first and begin at one instant, or nobody moves.
    """
    if geo and site:
        raise click.UsageError("--geo and --site contradict each other")
    if bool(places) == (path is not None):
        raise click.UsageError("either places or --path is needed")
    name = places[0] if len(places) == 1 and is_name(places[0]) else ""
    if name and (geo or site):
        raise click.UsageError(f"{name} has a frame of its own: leave --geo and --site out")
    said = None if name else _aim(places, path, geo=geo, site=site)

    def messages(edges: Edges, robots: list[RobotState]) -> list[dict[str, object]]:
        aim = said or _of_place(edges.place(name, robots))
        aim = msgspec.structs.replace(aim, yaw=aim.yaw if yaw is None else yaw, speed=speed, spacing=spacing)
        made = goals(aim, robots)
        for state in robots:
            if state.separation:
                out.note(f"{state.name}: separation {state.separation}")
        return made

    return ask_each(out, robot, "navigate", messages, wait=wait, timeout=timeout, file=file, at=at)


def _aim(places: tuple[str, ...], path: Path | None, *, geo: bool, site: bool) -> GotoTarget:
    """Return where the command line, or its file, says to go."""
    route = read_route(path) if path is not None else _said(places)
    if route.geo and site:
        raise click.UsageError("--site is metres, and the places of the file are on Earth")
    frame = "geo" if geo or route.geo else "site" if site else "world"
    *way, (x, y, *z) = route.places
    return GotoTarget(x, y, z[0] if z else None, frame, way=tuple(way))


def _of_place(place: Place) -> GotoTarget:
    """Return how to go to a place of fleet.yaml."""
    x, y, *z = place.at
    frame = "geo" if place.frame == "geodetic" else "site"
    return GotoTarget(x, y, z[0] if z else None, frame, place.heading, named=place)


def _said(places: tuple[str, ...]) -> Waypoints:
    """Return the places of the command line."""
    try:
        return route_of(places)
    except Refused as error:
        raise click.UsageError(error.reason) from None


def goals(aim: GotoTarget, robots: list[RobotState]) -> list[dict[str, object]]:
    """Return each robot's message; raises Refused for one point for several, and without a common frame."""
    _require_one_frame(aim, robots)
    if aim.named is not None and (trouble := aim.named.trouble([Vector3()] * len(robots))):
        raise Refused(trouble)
    if len(robots) == 1:
        return [_message(aim, robots[0], Vector3())]
    if aim.way:
        raise Refused(f"one path for {len(robots)} robots: they would meet on it", hint="send each its own")
    if aim.spacing is None:
        raise Refused(
            f"one point for {len(robots)} robots: they would meet there",
            hint="--spacing 5 spreads them around it, 5 m from each other",
        )
    sites = [robot.site for robot in robots if robot.site is not None]
    steps: Sequence[Vector3] = spread(len(robots), aim.spacing)
    if len(sites) == len(robots):
        steps = arranged(sites, _centre(aim, robots[0], sites), aim.spacing)
    if aim.named is not None and (trouble := aim.named.trouble(steps)):
        raise Refused(trouble, hint="a smaller --spacing, or fewer robots")
    return [_message(aim, robot, step) for robot, step in zip(robots, steps, strict=True)]


def _centre(aim: GotoTarget, robot: RobotState, sites: Sequence[Vector3]) -> Vector3:
    """Return the place in the site's frame; one on Earth is not known there: the middle of the robots."""
    if aim.frame == "geo" or robot.placement is None:
        return sum(sites, Vector3()).scaled(1 / len(sites))
    place = Vector3(aim.x, aim.y, aim.z or 0.0)
    return place if aim.frame == "site" else robot.placement.to_site(place)


def _require_one_frame(aim: GotoTarget, robots: list[RobotState]) -> None:
    """Raise Refused where the coordinates do not mean the same place for all of the robots."""
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
    """Return whether two worlds are the same."""
    if one is None or other is None:
        return False
    return (one.origin - other.origin).norm() <= ONE_FRAME and abs(one.yaw - other.yaw) <= ONE_FRAME


def _message(aim: GotoTarget, robot: RobotState, step: Vector3) -> dict[str, object]:
    """Return the message that sends a robot to the place, ``step`` beside it, or along its path."""
    message: dict[str, object] = {"command": "goto", "action_id": uuid.uuid4().hex}
    yaw = aim.yaw
    if yaw is not None and aim.frame == "site" and robot.placement is not None:
        yaw -= robot.placement.yaw
    turned: dict[str, object] = {} if yaw is None else {"yaw": yaw}
    if yaw is not None and aim.frame == "geo":
        turned = {"orientation": {"heading": (90.0 - math.degrees(yaw)) % 360.0}}
    if aim.way:
        last = (aim.x, aim.y) if aim.z is None else (aim.x, aim.y, aim.z)
        *way, end = (_place(aim.frame, place, robot, step) for place in (*aim.way, last))
        message["waypoints"] = [*way, end | turned]
    else:
        # A place of fleet.yaml without a height is no place for an aircraft, and not one on the ground.
        height = () if aim.named is not None and aim.z is None else (aim.z or 0.0,)
        message |= _place(aim.frame, (aim.x, aim.y, *height), robot, step) | turned
    if aim.speed is not None:
        message["constraints"] = {"max_speed_ms": aim.speed}
    return message


def _place(frame: str, place: Sequence[float], robot: RobotState, step: Vector3) -> dict[str, object]:
    """Return one place in the words of the message; a height that is not given is not said."""
    if frame == "geo":
        point = geo_from_world(GeoOrigin(place[0], place[1]), step)
        height = {"altitude": place[2]} if len(place) > 2 else {}
        return {"geodetic_position": {"latitude": point.latitude, "longitude": point.longitude, **height}}
    position = Vector3(*place) + step
    if frame == "site" and robot.placement is not None:
        position = robot.placement.to_world(position)
    return {"position": [position.x, position.y, position.z][: len(place)]}
