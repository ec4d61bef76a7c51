"""``fleet goto``: send a robot, or the robots of a group, to a place."""

from __future__ import annotations

from pathlib import Path

import click
import msgspec

from fleet.cli.common_start import at_option
from fleet.cli.completion import PLACE, ROBOT
from fleet.cli.options import reach_option, timeout_option, wait_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.send import request_each
from fleet.client.edges import Edges
from fleet.config.route import Waypoints, is_name, read_route, route_of
from fleet.errors import Refused
from fleet.model.state import RobotState
from fleet.wire.goals import GotoTarget, goals, target_of


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
    help="Spread the robots of a group around the place, by this distance in metres.",
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

    The file of --path has one place per line (CSV: x,y[,z], or below a heading
    latitude,longitude[,altitude]), or is GeoJSON: one LineString, or Points in order. Altitudes are above the
    take-off point; aircraft need one at each place.

    The robots of a group go to places around the given one, --spacing metres from each other, as many as
    PLACE has room for. With --at, all are prepared first and begin at one instant, or none moves.
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
        aim = said or target_of(edges.place(name, robots))
        aim = msgspec.structs.replace(aim, yaw=aim.yaw if yaw is None else yaw, speed=speed, spacing=spacing)
        made = goals(aim, robots)
        for state in robots:
            if state.separation:
                out.note(f"{state.name}: separation {state.separation}")
        return made

    return request_each(out, robot, "navigate", messages, wait=wait, timeout=timeout, file=file, at=at)


def _aim(places: tuple[str, ...], path: Path | None, *, geo: bool, site: bool) -> GotoTarget:
    """Return the target from the command line or its file."""
    route = read_route(path) if path is not None else _waypoints(places)
    if route.geo and site:
        raise click.UsageError("--site is metres, and the places of the file are on Earth")
    frame = "geo" if geo or route.geo else "site" if site else "world"
    *via, (x, y, *z) = route.places
    return GotoTarget(x, y, z[0] if z else None, frame, via=tuple(via))


def _waypoints(places: tuple[str, ...]) -> Waypoints:
    """Return the places of the command line."""
    try:
        return route_of(places)
    except Refused as error:
        raise click.UsageError(error.reason) from None
