"""``fleet demo``: simulated robots, a broker, the bus and the bridge, without any setup."""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import json
import shutil
import sys
import tempfile
import uuid
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click

from fleet.bus.settings import is_running, running_edges, runtime_dir
from fleet.cli.options import log_options
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.serve import logs_to, serve
from fleet.client.local_user import local_user
from fleet.config.load import load
from fleet.console.child import is_installed
from fleet.console.login_links import LinkRequest
from fleet.errors import BusError
from fleet.host.edge.edge import Edge
from fleet.model.permission import Permission
from fleet.sim.broker.thread import BrokerThread

NAMESPACE = uuid.UUID("8f1c1f0e-6d0b-4c3e-9d57-0f1ee7000000")
EDGE = "demo"
MQTT_PORT = 1883
FIELD = (47.397742, 8.545594, 488.0)  # the site's origin, near Zurich: degrees, m above sea level
SPACING = 0.0001  # degrees of latitude between two drones, northwards: 11 m
ROW = 2.0  # m between two robots on the ground, southwards
FLAVOURS = ("px4", "ardupilot")
UGV = "waveshare-beast"


PATROL = "patrol"
ROUND = {"mission": PATROL, "every": "10 min", "enabled": False}  # disabled, so that nothing moves by itself
"""The mission of a demo with a drone or a wheeled robot."""


class DemoExample(NamedTuple):
    """Example for the first robot of a kind: a command, its data, and a goal (m)."""

    robot: str
    command: str
    data: Mapping[str, float]
    goal: str


TRIES = (
    DemoExample("drone-1", "takeoff", {"altitude": 5}, "10 0 5"),
    DemoExample("dog-1", "stand_up", {}, "1 0.5 0"),
    DemoExample("ugv-1", "move_forward", {"distance": 1}, "1 0.5 0"),
)


def twin_of(name: str, edge: str = EDGE) -> str:
    """Return the twin of an edge's robot; always the same, so that scripts can use it."""
    return str(uuid.uuid5(NAMESPACE, name if edge == EDGE else f"{edge}/{name}"))


def _link(number: int) -> str:
    """Return the link of a simulated drone: alternating autopilots, side by side in a field near Zurich."""
    latitude, longitude, altitude = FIELD
    home = f"{latitude + SPACING * number:.6f},{longitude},{altitude:g},0"
    return f"sim:{FLAVOURS[(number - 1) % 2]}?home={home}"


def _start(number: int) -> list[float]:
    """Return the start of a ground robot; it faces east, away from the row."""
    return [0.0, -ROW * number, 0.0]


def _robot(name: str, edge: str, **fields: object) -> dict[str, object]:
    """Return one simulated robot that obeys every user of the demo."""
    accepts = {"command": ["tele", "sim_tele"], "navigate": ["tele", "edge", "sim", "sim_tele"]}
    return {"name": name, "twin": twin_of(name, edge), **fields, "accepts": accepts}


def _patrol(kinds: Mapping[str, Sequence[object]]) -> dict[str, object]:
    """Return the demo's mission for the robots present; none for dogs alone."""
    there = [kind for kind in ("drones", "ugvs") if kinds[kind]]
    roles = {"drones": "eye", "ugvs": "feet"}
    actions = {"drones": {"goto": [6, 0, 5]}, "ugvs": {"goto": [2, -ROW]}}
    if not there:
        return {}
    up = {"eye": {"command": "takeoff", "with": {"altitude": {"input": "height"}}}}
    steps: list[dict[str, object]] = [
        {
            "id": "round",
            "start": "together",
            "timeout": "2 min",
            "do": {roles[kind]: actions[kind] for kind in there},
        }
    ]
    if "drones" in there:
        steps.insert(0, {"id": "up", "do": up, "undo": {"eye": "land"}})
        steps.append({"id": "home", "do": {"eye": "land"}})
    mission = {
        "version": 1,
        "summary": "Robots go round together.",
        "inputs": {"height": {"type": "number", "unit": "m", "default": 5, "min": 3, "max": 30}},
        "roles": {roles[kind]: {"from": kind} for kind in there},
        "steps": steps,
        "on_failure": "undo",
    }
    return {PATROL: mission}


def demo_file(drones: int, host: str, port: int, *, ugvs: int = 0, dogs: int = 0, edge: str = EDGE) -> str:
    """Return the fleet file of the demo as JSON (which is YAML); its state is beside the file."""
    kinds = {
        "drones": [
            _robot(f"drone-{n}", edge, adapter="mavlink", link=_link(n)) for n in range(1, drones + 1)
        ],
        "ugvs": [
            _robot(f"ugv-{n}", edge, adapter="ugv", profile=UGV, link=f"sim:{UGV}", start=_start(n))
            for n in range(1, ugvs + 1)
        ],
        "dogs": [
            _robot(
                f"dog-{n}",
                edge,
                adapter="quadruped",
                link="sim:auto",
                captures="captures",
                start=_start(ugvs + n),
            )
            for n in range(1, dogs + 1)
        ],
    }
    fleet = {
        "edge": {"id": edge, "spool": {"path": "state"}},
        "cloud": {"host": host, "port": port, "tls": False, "insecure": True},
        "site": {"origin": FIELD},
        "robots": [robot for robots in kinds.values() for robot in robots],
        "groups": {kind: [robot["name"] for robot in robots] for kind, robots in kinds.items() if robots},
        "missions": (missions := _patrol(kinds)),
        "schedules": {"round": ROUND} if missions else {},
        "console": {} if is_installed() else None,
    }
    return json.dumps(fleet, indent=2)


@click.command()
@click.option("--drones", type=click.IntRange(0, 100), default=1, show_default=True, help="How many.")
@click.option("--ugvs", type=click.IntRange(0, 100), default=1, show_default=True, help="Wheeled robots.")
@click.option(
    "--dogs",
    type=click.IntRange(0, 10),
    default=lambda: int(importlib.util.find_spec("can") is not None),
    show_default="1 with the extra can",
    help="Quadrupeds (extra can).",
)
@click.option("--broker", metavar="HOST:PORT", help="Use this MQTT broker instead of the built-in one.")
@click.option("--edge-id", default=EDGE, show_default=True, help="Name of the edge; another for each demo.")
@log_options
@with_output
def demo(  # noqa: PLR0917 - click's options
    out: Output, drones: int, ugvs: int, dogs: int, broker: str | None, edge_id: str, **logs: Any
) -> ExitCode:
    """Run simulated robots; nothing else is needed.

    Starts an MQTT broker, simulated drones that speak real MAVLink (PX4 and ArduPilot in turn), wheeled
    robots on serial devices, quadrupeds with CAN drives, the bus and the bridge, and shows one line for each
    robot until Ctrl-C. It prints a link to the console, which shows the robots on a map in the browser. A
    second demo beside it needs an --edge-id of its own; free ports are used instead of taken ones.
    """
    if drones + ugvs + dogs == 0:
        raise click.UsageError("there is nothing to show: ask for one of --drones, --ugvs, --dogs at least")
    _require_free(edge_id)
    with contextlib.ExitStack() as stack:
        host, port = _address(broker) if broker else ("127.0.0.1", 0)
        if broker is None:
            port = stack.enter_context(_own_broker(host)).port
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="fleet-demo-")))
        path = folder / "fleet.yaml"
        path.write_text(demo_file(drones, host, port, ugvs=ugvs, dogs=dogs, edge=edge_id), encoding="utf-8")
        loaded = load(path)

        def started(_edge: Edge) -> None:
            there = {config.name for config, _ in loaded.robots}
            _write_examples(out, host, port, [one for one in TRIES if one.robot in there], edge_id)

        wanted = logs_to(logs["verbose"], logs["log_file"], logs["log_format"])
        link = LinkRequest(local_user(), Permission.ADMIN)
        return serve(loaded, out, logs=wanted, started=started, link=link)


def _require_free(edge: str) -> None:
    """Raise BusError, with the option for another demo, if an edge of this id runs here."""
    directory = runtime_dir()
    if is_running(edge, directory):
        taken = running_edges(directory)
        free = next(name for number in itertools.count(2) if (name := f"{EDGE}-{number}") not in taken)
        raise BusError(
            f"edge {edge!r} runs already on this machine (fleet ps); stop it, or start another demo "
            f"beside it with --edge-id {free}"
        )


def _write_examples(
    out: Output, host: str, port: int, tries: Sequence[DemoExample], edge: str = EDGE
) -> None:
    """Print addresses and examples for a robot that is present."""
    out.note(f"MQTT broker       {host}:{port}")
    for robot, command, data, goal in tries[:1]:
        topic = f"cyberwave/twin/{twin_of(robot, edge)}"
        name = robot if edge == EDGE else f"{edge}/{robot}"  # the first demo has a robot of this name too
        message = json.dumps({"command": command, "source_type": "tele", "data": data})
        words = " ".join([command, *(f"{name}={value}" for name, value in data.items())])
        label = f"{robot}'s topics"
        out.note(f"{label:17} {topic}/+")
        out.note("try, in another terminal:")
        out.note(f"  {fleet_program()} ps")
        if robot.startswith(("drone", "ugv")) and edge == EDGE:
            out.note(f"  {fleet_program()} mission rehearse {PATROL}")
            out.note(f"  {fleet_program()} mission run {PATROL}")
        out.note(f"  {fleet_program()} send {name} {words} --wait")
        out.note(f"  {fleet_program()} goto {name} {goal} --wait")
        out.note(f"  mosquitto_sub -h {host} -p {port} -v -t '{topic}/#'")
        out.note(f"  mosquitto_pub -h {host} -p {port} -t {topic}/command -m '{message}'")
    out.note("Ctrl-C ends it.")


def fleet_program() -> str:
    """Return how the user can call ``fleet`` from here: by name or by path."""
    if shutil.which("fleet"):
        return "fleet"
    path = Path(sys.executable).with_name("fleet")
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


@contextlib.contextmanager
def _own_broker(host: str) -> Iterator[BrokerThread]:
    """Run a broker on the standard port of MQTT, or on any port if that is taken.

    It is not asked first whether the port is free: another demo that starts now could take it meanwhile.
    """
    with contextlib.ExitStack() as stack:
        try:
            broker = stack.enter_context(BrokerThread(host=host, port=MQTT_PORT, tells_unheard=False))
        except OSError:
            broker = stack.enter_context(BrokerThread(host=host, port=0, tells_unheard=False))
        yield broker


def _address(text: str) -> tuple[str, int]:
    """Parse HOST:PORT."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise click.BadParameter(f"{text!r} is not HOST:PORT (as in localhost:1883)", param_hint="--broker")
    return host, int(port)
