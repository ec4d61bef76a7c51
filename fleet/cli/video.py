"""``fleet video``: the program that sends a robot's camera as WebRTC video, beside the edge."""

from __future__ import annotations

import asyncio
import logging
import os
import re

import click

from fleet.bus.settings import BusSettings, runtime_dir
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.client.edges import Edges
from fleet.clock import SystemClock
from fleet.errors import Refused
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.model.state import RobotState
from fleet.runtime.event_loop import run

EXTRA = "fleet video needs its extra: pip install 'zenoh-fleet[video]' (here: uv sync --extra video)"
SENSOR = re.compile(r"[a-z][a-z0-9_]{0,62}")
ICE_URL = re.compile(r"(stun|turns?):[^\s:?]+(:\d{1,5})?(\?transport=(udp|tcp))?")
CAMERA = re.compile(r"(file:/|https?://|v4l2:/)\S+")


def _sensor(_context: click.Context, _option: click.Parameter, value: str) -> str:
    """Check the name of a sensor, which is part of a bus key."""
    if not SENSOR.fullmatch(value):
        raise click.BadParameter(f"{value!r}: small letters, digits and _, a letter first")
    return value


def _camera(_context: click.Context, _option: click.Parameter, value: str | None) -> str | None:
    """Check a camera."""
    if value is not None and not CAMERA.fullmatch(value):
        raise click.BadParameter(f"{value!r}: http(s)://..., file:/... or v4l2:/dev/videoN is needed")
    return value


def _servers(_context: click.Context, _option: click.Parameter, values: tuple[str, ...]) -> tuple[str, ...]:
    """Check the addresses of servers."""
    for value in values:
        if not ICE_URL.fullmatch(value):
            raise click.BadParameter(
                f"{value!r}: stun:HOST:PORT, turn:HOST:PORT or turns:HOST:PORT is needed"
            )
    return values


@click.command()
@click.argument("robot")
@click.option(
    "--camera",
    callback=_camera,
    help="http(s)://... (fetched for each picture), v4l2:/dev/videoN or file:/...; left out, "
    "the robot's camera in the file of -f.",
)
@click.option("--sensor", default="camera", show_default=True, callback=_sensor, help="The stream's name.")
@click.option(
    "--rate",
    type=click.FloatRange(0.2, 30.0),
    default=10.0,
    show_default=True,
    help="Limit of pictures per second.",
)
@click.option(
    "--ice-server",
    "ice_urls",
    multiple=True,
    callback=_servers,
    metavar="URL",
    help="stun:HOST:PORT, turn:... or turns:...; left out, only the addresses of this computer.",
)
@click.option("--ice-user", envvar="FLEET_ICE_USER", show_envvar=True, help="For a TURN server.")
@click.option("--ice-password", envvar="FLEET_ICE_PASSWORD", show_envvar=True, help="For a TURN server.")
@reach_option
@with_output
def video(
    out: Output,
    robot: str,
    *,
    camera: str | None,
    sensor: str,
    rate: float,
    ice_urls: tuple[str, ...],
    ice_user: str | None,
    ice_password: str | None,
    file: str | None,
) -> ExitCode:
    """Send ROBOT's camera as WebRTC video whenever start_video asks for it, until Ctrl-C.

    It joins the bus of the edge that runs the robot. Give each camera of a robot its own --sensor.
    """
    try:
        from aiortc import RTCIceServer  # noqa: PLC0415 - of an extra

        from fleet.video.program import CameraSource, send_video  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise click.ClickException(f"there is no {error.name}: {EXTRA}") from None
    state, settings, configured = _found(robot, file)
    used = camera or configured
    if used is None:
        raise Refused(
            f"{robot} has no camera", hint="give --camera, or camera: in fleet.yaml and -f fleet.yaml"
        )
    servers = [RTCIceServer(url, ice_user, ice_password) for url in ice_urls]
    source = CameraSource(state.name, state.twin, used, sensor, rate, servers)
    start_logging(LogSettings(logging.INFO))
    logging.getLogger("aioice").setLevel(logging.WARNING)
    out.note(f"video of {state.name} ({sensor}) is sent when start_video asks for it; Ctrl-C ends it")

    async def serve() -> None:
        ended = asyncio.Event()
        end_by_signal(ended.set)
        await send_video(source, settings, runtime_dir(), ended, SystemClock())

    run(serve())
    return ExitCode.OK


def _found(robot: str, file: str | None) -> tuple[RobotState, BusSettings, str | None]:
    """Return the robot of this name, the bus of its edge, and its camera in the file, if any."""
    with Edges.reach(file) as edges:
        found = edges.named(robot)
    if len(found) != 1 or robot not in (found[0].name, f"{found[0].edge}/{found[0].name}"):
        raise Refused(f"{robot!r} is a group; each camera has a program of its own")
    state = found[0]
    if file is None:
        return state, BusSettings(state.edge), None
    from fleet.config.load import load  # noqa: PLC0415 - pydantic is not needed without a file
    from fleet.host.process.component_settings import bus_settings  # noqa: PLC0415

    loaded = load(file, os.environ, partial=True)
    cameras = {config.name: getattr(config, "camera", None) for config, _ in loaded.robots}
    return state, bus_settings(loaded.config), cameras.get(state.name)
