"""``fleet goto``: sending a robot, or the robots of a group, to a place."""

from __future__ import annotations

import itertools
import uuid
from collections.abc import Sequence
from typing import Any

import click
import msgspec

from fleet.cli.completion import ROBOT
from fleet.cli.options import reach_option, timeout_option, wait_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.send import ask_each
from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, geo_from_world
from fleet.model.geometry import Vector3
from fleet.model.site import Placement
from fleet.model.spread import arranged, spread
from fleet.model.state import RobotState

ONE_FRAME = 0.05  # m, and rad, by which two worlds may differ and be one


class Aim(msgspec.Struct, frozen=True):
    """Where to go: metres in ``frame`` (world: each robot's own, site), or degrees (geo)."""

    x: float
    y: float
    z: float
    frame: str = "world"
    yaw: float | None = None
    speed: float | None = None
    spacing: float | None = None


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("robot", type=ROBOT)
@click.argument("x", type=float)
@click.argument("y", type=float)
@click.argument("z", type=float, default=0.0)
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
@reach_option
@with_output
def goto(
    out: Output,
    robot: str,
    x: float,
    y: float,
    z: float,
    *,
    yaw: float | None,
    speed: float | None,
    geo: bool,
    site: bool,
    spacing: float | None,
    wait: bool,
    timeout: float,
    file: str | None,
) -> ExitCode:
    """Send ROBOT to X Y Z, metres in its world frame.

    For example:  fleet goto kestrel 10 0 5 --wait

    The robots of a group go to places around the one that is said, --spacing metres from each other.
    """
    if geo and site:
        raise click.UsageError("--geo and --site contradict each other")
    aim = Aim(x, y, z, "geo" if geo else "site" if site else "world", yaw, speed, spacing)

    def messages(robots: list[RobotState]) -> list[dict[str, Any]]:
        made = goals(aim, robots)
        for state in robots:
            if state.separation:
                out.note(f"{state.name}: separation {state.separation}")
        return made

    return ask_each(out, robot, "navigate", messages, wait=wait, timeout=timeout, file=file)


def goals(aim: Aim, robots: list[RobotState]) -> list[dict[str, Any]]:
    """Return each robot's message; raises Refused for one point for several, and without a common frame."""
    _require_one_frame(aim, robots)
    if len(robots) == 1:
        return [_message(aim, robots[0], Vector3())]
    if aim.spacing is None:
        raise Refused(
            f"one point for {len(robots)} robots: they would meet there",
            hint="--spacing 5 spreads them around it, 5 m from each other",
        )
    sites = [robot.site for robot in robots if robot.site is not None]
    steps: Sequence[Vector3] = spread(len(robots), aim.spacing)
    if len(sites) == len(robots):
        steps = arranged(sites, _centre(aim, robots[0], sites), aim.spacing)
    return [_message(aim, robot, step) for robot, step in zip(robots, steps, strict=True)]


def _centre(aim: Aim, robot: RobotState, sites: Sequence[Vector3]) -> Vector3:
    """Return the place in the site's frame; one on Earth is not known there: the middle of the robots."""
    if aim.frame == "geo" or robot.placement is None:
        return sum(sites, Vector3()).scaled(1 / len(sites))
    place = Vector3(aim.x, aim.y, aim.z)
    return place if aim.frame == "site" else robot.placement.to_site(place)


def _require_one_frame(aim: Aim, robots: list[RobotState]) -> None:
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


def _message(aim: Aim, robot: RobotState, step: Vector3) -> dict[str, Any]:
    """Return the message that sends a robot to the place, ``step`` beside it."""
    message: dict[str, Any] = {"command": "goto", "action_id": uuid.uuid4().hex}
    yaw = aim.yaw
    if aim.frame == "geo":
        point = geo_from_world(GeoOrigin(aim.x, aim.y), step)
        place = {"latitude": point.latitude, "longitude": point.longitude, "altitude": aim.z}
        message["geodetic_position"] = place
    else:
        position = Vector3(aim.x, aim.y, aim.z) + step
        if aim.frame == "site" and robot.placement is not None:
            position = robot.placement.to_world(position)
            yaw = None if yaw is None else yaw - robot.placement.yaw
        message["position"] = [position.x, position.y, position.z]
    if yaw is not None:
        message["yaw"] = yaw
    if aim.speed is not None:
        message["constraints"] = {"max_speed_ms": aim.speed}
    return message
