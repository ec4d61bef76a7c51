"""``fleet can``: a dog on the bench. None of these commands enables a drive."""

from __future__ import annotations

import json
from pathlib import Path

import click

from fleet.clock import SystemClock
from fleet.errors import LinkRefused
from fleet_quadruped.bench import Bench, offsets, open_buses, problems, scan
from fleet_quadruped.robot.description import Description, load_description

_BODY = click.argument("body", type=click.Path(dir_okay=False, path_type=Path))
_BUS = click.option("--bus", "buses", multiple=True, metavar="NAME=URL", help="A bus: a=can:socketcan:can0.")


@click.group()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON list of lines for programs.")
@click.pass_context
def can(context: click.Context, *, as_json: bool) -> None:
    """Look at a quadruped's CAN buses and drives; nothing here enables a drive."""
    context.obj = as_json


def _show(lines: list[str]) -> None:
    """Write the result: a line each, or one JSON list."""
    click.echo(json.dumps(lines, indent=2) if click.get_current_context().obj else "\n".join(lines))


@can.command("scan")
@click.argument("url")
@click.option("--bitrate", type=int, default=1_000_000, show_default=True)
def scan_command(url: str, bitrate: int) -> int:
    """List the devices that answer on a bus (can:socketcan:can0)."""
    clock = SystemClock()
    with open_buses({"bus": url}, {"bus": bitrate}, clock) as buses:
        found = scan(buses["bus"], clock)
    _show([*found, f"{len(found)} devices"])
    return 0 if found else 1


@can.command("check")
@_BODY
@_BUS
def check_command(body: Path, buses: tuple[str, ...]) -> int:
    """Check a description, and with --bus also the drives that it names."""
    dog = load_description(body)
    lines = [
        f"bus {bus}: {load:.0%} of {dog.buses[bus].bitrate} bit/s at {dog.drive.cycle_hz} cycles a second"
        for bus, load in dog.loads.items()
    ]
    if not buses:
        _show([*lines, f"{body}: ok; add --bus to look at the drives"])
        return 0
    with open_buses(_urls(dog, buses), _bitrates(dog), SystemClock()) as opened:
        found = problems(dog, Bench(dog, opened, SystemClock()).settle())
    verdict = f"{len(found)} problems" if found else "all twelve drives answer, where their joints can be"
    _show([*lines, *found, verdict])
    return 1 if found else 0


@can.command("monitor")
@_BODY
@_BUS
@click.option("--seconds", type=click.FloatRange(0.1), default=5.0, show_default=True)
def monitor_command(body: Path, buses: tuple[str, ...], seconds: float) -> int:
    """Show joints once a second: angle, torque, state, age of the feedback; frames a second."""
    dog = load_description(body)
    with open_buses(_urls(dog, buses), _bitrates(dog), SystemClock()) as opened:
        bench = Bench(dog, opened, SystemClock())
        for _ in range(max(1, round(seconds))):
            bench.frames.clear()
            told = bench.settle(dog.drive.cycle_hz - 1)
            lines = [
                f"{joint.name:8} {feedback.angle:7.3f} rad {feedback.torque:6.2f} N m "
                f"{feedback.power.value:9} {feedback.age * 1000:6.1f} ms  {feedback.fault}"
                for joint, feedback in zip(dog.all_joints, told, strict=True)
            ]
            _show([*lines, *(f"bus {name}: {count} frames/s" for name, count in bench.frames.items())])
    return 0


@can.command("calibrate")
@_BODY
@_BUS
@click.option("--pose", type=click.Choice(["fold", "stand"]), default="fold", show_default=True)
@click.option("--yes", is_flag=True, help="The dog is in that pose; do not ask.")
def calibrate_command(body: Path, buses: tuple[str, ...], pose: str, *, yes: bool) -> int:
    """Measure joint offsets of a dog that a person has put into a known pose; prints YAML, writes nothing."""
    dog = load_description(body)
    if not yes:
        click.confirm(f"Is the dog in the pose {pose!r}, and are its drives off?", abort=True, err=True)
    wanted = dog.posture(dog.poses.fold) if pose == "fold" else dog.stance(dog.gait.height)
    with open_buses(_urls(dog, buses), _bitrates(dog), SystemClock()) as opened:
        told = Bench(dog, opened, SystemClock()).settle()
    silent = [line for line in problems(dog, told) if "is silent" in line]
    if silent:
        raise LinkRefused(silent[0])
    found = offsets(dog, told, wanted)
    _show([f"{name}: offset {found[name]:+.4f} (now {dog.joints[name].offset:+.4f})" for name in found])
    return 0


def _urls(dog: Description, given: tuple[str, ...]) -> dict[str, str]:
    """Return the buses by name; raises LinkRefused when they are not those of the description."""
    urls = {name: url for name, _, url in (text.partition("=") for text in given)}
    if set(urls) != set(dog.buses):
        raise LinkRefused(f"give --bus NAME=URL for each of {', '.join(dog.buses)}")
    return urls


def _bitrates(dog: Description) -> dict[str, int]:
    return {name: bus.bitrate for name, bus in dog.buses.items()}
