"""Who may command what: every source type, every command, real and simulated, by every way in.

The robots are offline, so whatever is admitted is refused for that, and nothing else has to be there. What
each identity on the bus may do is the bus's business; a robot sees the way and the source type.
"""

import asyncio
import itertools
import json
import uuid

import pytest

from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.model.command import Transport
from fleet.robot_config import Accepts
from fleet.testing.clock import LoopClock
from fleet.wire.commands import SETTINGS
from fleet.wire.stops import STOP_WORDS
from fleet.wire.verbs import VERBS
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_quadruped.adapter import QuadrupedAdapter
from fleet_ugv.adapter import UgvAdapter
from tests.fleet.host.field import local_robot

MISSING = "no source type"
SOURCES = (
    MISSING,
    *("edge", "edge_leader", "edge_follower", "tele", "sim", "sim_tele", "edit", "preview"),
    *("robot", "TELE", "", " tele"),
)
"""Cyberwave's words, those that were retired, those that nobody knows, and none."""

REAL = {"tele"}
SIMULATED = {"sim", "sim_tele"}
GOAL = {"position": {"x": 1.0, "y": 0.0, "z": 2.0}}
DATA = {
    "move": {"linear_x": 0.1},
    "set_linear_velocity": {"linear": 0.1},
    "set_angular_velocity": {"angular": 0.1},
    "locomotion_velocity": {"linear": {"x": 0.1}, "duration_s": 0.2},
}
"""What a command cannot be read without."""

DRONE = {"adapter": "mavlink", "link": "udpin:127.0.0.1:0"}
DOG = {"adapter": "quadruped", "link": "sim:kinematic"}
BASE = {"adapter": "ugv", "profile": "waveshare-beast", "link": "serial:/dev/ttyUSB0?baud=115200"}
BEHIND = ("offline", "the robot's position is unknown")  # refusals of what is looked at afterwards
IMPOSSIBLE = ("has no", "it stays on the ground", "it does not move sideways")
ROBOTS = {
    "drone": (MavlinkAdapter, DRONE, DRONE | {"link": "sim:px4"}),
    "dog": (QuadrupedAdapter, None, DOG),
    "base": (UgvAdapter, BASE, BASE | {"link": "sim:waveshare-beast"}),
}


def robot_of(adapter, fields, **more):
    loop = asyncio.get_running_loop()
    clock = LoopClock(loop)
    config = adapter.Config(name="rex", twin=uuid.UUID(int=1), **fields, **more)
    return local_robot(config, adapter, clock=clock, scheduler=TickScheduler(loop, clock))


def message_of(source, **fields):
    return json.dumps(fields if source == MISSING else fields | {"source_type": source}).encode()


def commands_of(robot):
    """Return every command that such a robot, or any, is asked: its own, the verbs, the host's."""
    own = set(robot.controller.can.commands)
    return sorted(own | set(VERBS) | set(SETTINGS) | {"move", "restart_adapter", "release_emergency_stop"})


def requests_of(robot, source):
    """Return each thing that can be asked: its name, kind, payload, and whether it is navigation."""
    for name in commands_of(robot):
        body = {"command": name, "data": DATA.get(name, {})}
        yield name, "command", message_of(source, **body), False
    yield "a velocity", "motion", message_of(source, linear={"x": 0.1}, angular={"z": 0.0}), False
    goal = {"command": "goto", "action_id": uuid.uuid4().hex, **GOAL}
    yield "a goal", "navigate", message_of(source, **goal), True


def verdict(robot, kind, payload, transport):
    """Return what becomes of a message: refused for its ``source``, ``admitted``, ``impossible``."""
    answers = []
    robot.read(kind, payload, transport=transport)(answers.append)
    if answers[0].ok or any(words in answers[0].reason for words in BEHIND):
        return "admitted"
    if "this robot accepts" in answers[0].reason:
        return "source"
    assert any(words in answers[0].reason for words in IMPOSSIBLE), answers[0]
    return "impossible"


KINDS = [
    (name, adapter, fields, fields is simulated)
    for name, (adapter, real, simulated) in ROBOTS.items()
    for fields in (real, simulated)
    if fields is not None
]


@pytest.mark.parametrize(("_name", "adapter", "fields", "simulated"), KINDS)
def test_a_robot_obeys_its_source_types_for_everything_and_nobody_else(_name, adapter, fields, simulated):
    async def wrong():
        robot = robot_of(adapter, fields)
        for source, transport in itertools.product(SOURCES, (Transport.CLOUD, Transport.BUS)):
            for request, kind, payload, navigation in requests_of(robot, source):
                allowed = SIMULATED if simulated else REAL | ({"edge"} if navigation else set())
                local = transport is Transport.BUS and source == MISSING
                expected = "admitted" if source in allowed or local else "source"
                found = verdict(robot, kind, payload, transport)
                if found not in (expected, "impossible"):
                    yield source, transport, request, found

    async def all_wrong():
        return [each async for each in wrong()]

    assert asyncio.run(all_wrong()) == []


@pytest.mark.parametrize(("_name", "adapter", "fields", "simulated"), KINDS)
def test_a_stop_is_obeyed_whoever_sends_it(_name, adapter, fields, simulated):
    async def stops():
        robot = robot_of(adapter, fields)
        for source, transport, word in itertools.product(
            SOURCES, (Transport.CLOUD, Transport.BUS), sorted(STOP_WORDS)
        ):
            payload = message_of(source, command=word)
            assert verdict(robot, "command", payload, transport) == "admitted", (source, transport, word)
        return robot.controller.latched

    assert asyncio.run(stops())


def test_what_the_file_accepts_replaces_both_sets():
    async def decide():
        robot = robot_of(MavlinkAdapter, DRONE, accepts=Accepts(command={"edge"}))
        return {
            source
            for source in SOURCES
            if verdict(robot, "command", message_of(source, command="takeoff"), Transport.CLOUD) == "admitted"
        }

    assert asyncio.run(decide()) == {"edge"}
