"""What local programs and leaders publish on the bus for robots of this process to do now.

===========================================  ===============================================
``cw/{twin}/data/commands/velocity``         a velocity, for the robot of the twin
``cw/{twin}/data/commands/joint_positions``  joint targets, for the robot of the twin
``cw/{twin}/data/joint_states``              where a leader's joints are, for those that follow it
===========================================  ===============================================
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable

from fleet.bus.zenoh_session import ZenohSession
from fleet.errors import WireError
from fleet.host.robot.local_robot import LocalRobot
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.report import JointReport
from fleet.wire.databus import decode_report
from fleet.wire.joints import JOINT_TARGETS
from fleet.wire.rules import Kind

_KEYS: dict[Kind, str] = {"motion": "commands/velocity", "joints": "commands/joint_positions"}
_LEADER = "joint_states"


def take_setpoints(
    robots: Iterable[LocalRobot], reports: ZenohSession, loop: asyncio.AbstractEventLoop
) -> None:
    """Take from now on what is published for these robots."""
    robots = tuple(robots)
    for kind, channel in _KEYS.items():
        calls = {_key(robot.twin, channel): taker(robot, kind, loop) for robot in robots}
        reports.subscribe_many(_key("*", channel), calls)
    here = {robot.twin: robot for robot in robots}
    for robot in robots:
        leader = str(robot.config.follows)
        if leader in here:  # reports do not come back to the session that says them
            here[leader].controller.joints.followers.append(_beside(robot, loop))
        elif robot.config.follows is not None:
            reports.subscribe_many(*_followed(robot, leader, loop))


def taker(robot: LocalRobot, kind: Kind, loop: asyncio.AbstractEventLoop) -> Callable[[bytes], None]:
    """Return what takes setpoints of one kind for a robot; on the bus's thread."""

    def arrived(payload: bytes) -> None:
        take = robot.read(kind, payload, way=Transport.BUS)
        if take is not None:
            loop.call_soon_threadsafe(take, robot.tell_refused)

    return arrived


def _beside(robot: LocalRobot, loop: asyncio.AbstractEventLoop) -> Callable[[JointReport], None]:
    """Return what takes where a leader is that this process has too; its own turn is not held up by it."""

    def told(report: JointReport) -> None:
        loop.call_soon(robot.follow, report)

    return told


def _followed(
    robot: LocalRobot, leader: str, loop: asyncio.AbstractEventLoop
) -> tuple[str, dict[str, Callable[[bytes], None]]]:
    """Return a leader's key, and what takes what is told there for a robot that follows it."""

    def arrived(payload: bytes) -> None:
        try:
            report = decode_report(_LEADER, payload)
        except WireError as error:
            refusal = Reply(JOINT_TARGETS, ReplyStatus.REJECTED, f"its leader cannot be read: {error}")
            loop.call_soon_threadsafe(robot.tell_refused, refusal)
            return
        if isinstance(report, JointReport):
            loop.call_soon_threadsafe(robot.follow, report)

    key = _key(leader, _LEADER)
    return key, {key: arrived}


def _key(twin: str, channel: str) -> str:
    """Return the key of a twin's channel; ``*`` is every twin's."""
    return f"cw/{twin}/data/{channel}"
