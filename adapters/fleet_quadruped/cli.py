"""``fleet can``: tools for a robot on the bench. Only ``jog`` and ``check --move`` enable drives, and ask."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

import click

from fleet import CanBus, ConfigError, LinkRefused, SystemClock
from fleet_quadruped import commissioning
from fleet_quadruped.any_description import AnyBody, load_body
from fleet_quadruped.bench_tools import BenchSession, listen, offsets, open_buses, problems, scan
from fleet_quadruped.can.capture import read_capture
from fleet_quadruped.check_moves import CheckMoves
from fleet_quadruped.commissioning import at_rest
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.loop import ControlLoop
from fleet_quadruped.jog import (
    LEAST_DEGREES,
    MOST_DEGREES,
    MOST_SHARE,
    AbortInput,
    Jog,
    Jogger,
    JogStopped,
    direction,
    verdict,
)
from fleet_quadruped.replay import DriveReplay
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.robot.parts import CanBusConfig
from fleet_quadruped.selfwalk.description import SelfWalker

_BODY = click.argument("body", type=click.Path(dir_okay=False, path_type=Path))
_BUS = click.option("--bus", "buses", multiple=True, metavar="NAME=URL", help="A bus: a=can:socketcan:can0.")


@click.group()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON list of lines for programs.")
@click.pass_context
def can(context: click.Context, *, as_json: bool) -> None:
    """Look at a quadruped's CAN buses and drives; only jog and check --move enable any, after asking."""
    context.obj = as_json


def _show(lines: list[str]) -> None:
    """Print the result: one line each, or one JSON list."""
    click.echo(json.dumps(lines, indent=2) if click.get_current_context().obj else "\n".join(lines))


@can.command("scan")
@click.argument("url")
@click.option("--bitrate", type=int, default=1_000_000, show_default=True)
def scan_command(url: str, bitrate: int) -> int:
    """List the devices that answer on a bus (can:socketcan:can0)."""
    clock = SystemClock()
    with open_buses({"bus": url}, {"bus": CanBusConfig(bitrate=bitrate)}, clock) as buses:
        found = scan(buses["bus"], clock)
    _show([*found, f"{len(found)} devices"])
    return 0 if found else 1


@can.command("check")
@_BODY
@_BUS
@click.option(
    "--move", is_flag=True, help="Let it crouch and lean a little: shows signs and offsets. Asks first."
)
def check_command(body: Path, buses: tuple[str, ...], *, move: bool) -> int:
    """Check a description; with --bus also its drives, of a dog that lies folded on its belly."""
    dog = load_body(body)
    lines = [
        f"bus {bus}: {load:.0%} of {dog.buses[bus].bitrate} bit/s at {1 / dog.dt:.0f} cycles a second"
        for bus, load in dog.loads.items()
    ]
    if not buses:
        if move:
            raise LinkRefused("--move needs the --bus of each drive")
        _show([*lines, f"{body}: ok; add --bus to look at the drives"])
        return 0
    with open_buses(_urls(dog, buses), dog.buses, SystemClock()) as opened:
        if isinstance(dog, DogDescription):
            found, good = _checked(dog, opened, move=move)
        else:
            found, good = listen(dog, opened, SystemClock()).missing, "the machine reports its state"
    verdict = f"{len(found)} problems" if found else good
    _show([*lines, *found, verdict])
    return 1 if found else 0


def _checked(dog: DogDescription, buses: Mapping[str, CanBus], *, move: bool) -> tuple[list[str], str]:
    """Return the problems of a robot's drives and joints, and the verdict if there are none."""
    reported = BenchSession(dog, buses, SystemClock()).settle()
    found = problems(dog.all_joints, reported) or at_rest(dog, tuple(each.angle for each in reported))
    if found or not move:
        return found, "all twelve drives answer, within their joints' limits; --move shows signs and offsets"
    click.echo("It will fold its legs, crouch, and lean by up to 10 degrees. Any key stops it.", err=True)
    click.confirm(
        "Does it lie on its belly on a level floor, and do all people keep clear?", abort=True, err=True
    )
    pressed, controller = AbortInput(), Controller(dog, buses)
    controller.configure()
    with pressed.watching():
        moves = CheckMoves(dog, SystemClock(), pressed)
        ControlLoop(controller, buses, moves, SystemClock()).run()
    return commissioning.problems(dog, moves.looks, moves.ended), "signs and offsets of all joints are right"


@can.command("monitor")
@_BODY
@_BUS
@click.option("--seconds", type=click.FloatRange(0.1), default=5.0, show_default=True)
def monitor_command(body: Path, buses: tuple[str, ...], seconds: float) -> int:
    """Show joints once a second: angle, torque, state, age of the feedback; frames a second."""
    dog = load_body(body)
    if isinstance(dog, SelfWalker):
        with open_buses(_urls(dog, buses), dog.buses, SystemClock()) as opened:
            for _ in range(max(1, round(seconds))):
                heard = listen(dog, opened, SystemClock())
                _show([*(f"{name:8} {value:9.3f}" for name, value in heard.values.items()), *heard.missing])
        return 0
    with open_buses(_urls(dog, buses), dog.buses, SystemClock()) as opened:
        clock = SystemClock()
        bench = BenchSession(dog, opened, clock)
        for _ in range(max(1, round(seconds))):
            bench.frames.clear()
            began = clock.monotonic()
            reported = bench.settle(dog.drive.cycle_hz - 1)
            took = clock.monotonic() - began
            lines = [
                f"{joint.name:8} {feedback.angle:7.3f} rad {feedback.torque:6.2f} N m "
                f"{feedback.power.value:9} {feedback.age * 1000:6.1f} ms  {feedback.fault}"
                for joint, feedback in zip(dog.all_joints, reported, strict=True)
            ]
            _show(
                [
                    *lines,
                    *(f"bus {name}: {count / took:.0f} frames/s" for name, count in bench.frames.items()),
                ]
            )
    return 0


@can.command("replay")
@_BODY
@click.argument("capture", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--joint", "name", type=click.Choice(JOINTS), help="This joint; else the one farthest off.")
def replay_command(body: Path, capture: Path, name: str | None) -> int:
    """Show the frames before a fault: targets, angles, and the state of each drive."""
    lines = list(DriveReplay(_with_joints(body)).lines(read_capture(capture), name or ""))
    _show(lines or [f"{capture}: no frames"])
    return 0


@can.command("calibrate")
@_BODY
@_BUS
@click.option("--pose", type=click.Choice(["fold", "stand"]), default="fold", show_default=True)
@click.option("--yes", is_flag=True, help="The dog is in that pose; do not ask.")
def calibrate_command(body: Path, buses: tuple[str, ...], pose: str, *, yes: bool) -> int:
    """Measure joint offsets of a dog that a person has put into a known pose; prints YAML, writes nothing."""
    dog = _with_joints(body)
    if not yes:
        click.confirm(f"Is the dog in the pose {pose!r}, and are its drives off?", abort=True, err=True)
    wanted = dog.posture(dog.poses.fold) if pose == "fold" else dog.stance(dog.gait.height)
    with open_buses(_urls(dog, buses), dog.buses, SystemClock()) as opened:
        reported = BenchSession(dog, opened, SystemClock()).settle()
    silent = [line for line in problems(dog.all_joints, reported) if "is silent" in line]
    if silent:
        raise LinkRefused(silent[0])
    found = offsets(dog, reported, wanted)
    _show([f"{name}: offset {found[name]:+.4f} (now {dog.joints[name].offset:+.4f})" for name in found])
    return 0


@can.command("jog")
@_BODY
@_BUS
@click.option("--joint", "name", type=click.Choice(JOINTS), required=True, help="The one joint that moves.")
@click.option(
    "--degrees",
    type=click.FloatRange(-MOST_DEGREES, MOST_DEGREES),
    default=2.0,
    show_default=True,
    help="How far, from where it is.",
)
@click.option("--torque", type=click.FloatRange(0.0, min_open=True), help="N m at most; left out, a tenth.")
def jog_command(body: Path, buses: tuple[str, ...], name: str, degrees: float, torque: float | None) -> int:
    """Move one joint a little and slowly, and ask for its sign; any key stops it. Asks before it moves."""
    dog = _with_joints(body)
    joint = dog.all_joints[JOINTS.index(name)]
    most = MOST_SHARE * joint.kind.torque
    jog = Jog(joint, math.radians(degrees), torque or 0.1 * joint.kind.torque)
    if not abs(degrees) >= LEAST_DEGREES:
        raise LinkRefused(f"--degrees {degrees:g}: less than {LEAST_DEGREES:g} is not visible")
    if not jog.torque <= most:
        raise LinkRefused(f"--torque {jog.torque:g}: at most {most:.1f} N m for {name} on the bench")
    movement = direction(joint, forwards=degrees > 0)
    click.echo(
        f"{name}: id {joint.id} on bus {joint.bus}. It will move by {degrees:+g} degrees ({movement}), "
        f"with at most {jog.torque:.1f} N m. Any key stops it.",
        err=True,
    )
    click.confirm("Does the dog hang free, and do all people keep clear?", abort=True, err=True)
    pressed = AbortInput()
    with open_buses(_urls(dog, buses), dog.buses, SystemClock()) as opened:
        jogger = Jogger(dog, opened, SystemClock(), jog, pressed)
        try:
            with pressed.watching():
                moved = jogger.move()
        except JogStopped:
            _show([f"{name}: stopped by a key or a signal, and off"])
            return 1
    if abs(moved) < abs(jog.step) / 2:
        _show(
            [f"{name}: moved {math.degrees(moved):+.2f} of {degrees:+g} degrees; held, or --torque too low"]
        )
        return 1
    right = click.confirm(f"Did it move {movement}?", default=None, err=True)
    _show([f"{name}: moved {math.degrees(moved):+.2f} degrees; {verdict(joint, right=right)}"])
    return 0


def _with_joints(body: Path) -> DogDescription:
    """Return the description of a robot with joints; raises ConfigError for a self-walking machine."""
    dog = load_body(body)
    if isinstance(dog, SelfWalker):
        raise ConfigError(f"{body}: this machine walks on its own; fleet does not control its drives")
    return dog


def _urls(dog: AnyBody, given: tuple[str, ...]) -> dict[str, str]:
    """Return the given buses by name; raises LinkRefused unless they are those of the description."""
    urls = {name: url for name, _, url in (text.partition("=") for text in given)}
    if set(urls) != set(dog.buses):
        raise LinkRefused(f"give --bus NAME=URL for each of {', '.join(dog.buses)}")
    return urls
