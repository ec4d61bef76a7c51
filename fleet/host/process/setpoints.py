"""Setpoints that local programs and leaders publish on the bus for robots of this process.

===========================================  ===============================================
``cw/{twin}/data/commands/velocity``         a velocity, for the robot of the twin
``cw/{twin}/data/commands/joint_positions``  joint targets, for the robot of the twin
``cw/{twin}/data/joint_states``              joint positions of a leader, for its followers
===========================================  ===============================================
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from functools import partial

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


class Setpoints:
    """Receives setpoints for the robots of one process; on the event loop."""

    def __init__(self, reports: ZenohSession, loop: asyncio.AbstractEventLoop) -> None:
        self._reports, self._loop = reports, loop
        self._robots: dict[str, LocalRobot] = {}  # by twin
        self._followers: dict[str, list[Callable[[JointReport], object]]] = {}  # by the twin of their leader
        self._followed: dict[str, Callable[[], None]] = {}  # ends the subscription of each follower

    def start(self, robots: Collection[LocalRobot]) -> None:
        """Subscribe, for these robots and those added later."""
        for robot in robots:
            self.add(robot)
        for kind, channel in _KEYS.items():
            self._reports.subscribe(_key("*", channel), partial(self._arrived, kind))

    def add(self, robot: LocalRobot) -> None:
        """Receive the setpoints of a robot, and pass its joint reports to its followers in this process."""
        robot.controller.joints.followers = self._followers.setdefault(robot.twin, [])
        self._robots[robot.twin] = robot

    def remove(self, robot: LocalRobot) -> None:
        """Stop receiving the setpoints of a robot, and the joint positions of its leader."""
        if end := self._followed.pop(robot.twin, None):
            end()
        self._robots.pop(robot.twin, None)

    def _arrived(self, kind: Kind, key: str, payload: bytes) -> None:
        """Receive a setpoint, unless its key is that of no robot of this process; on the bus's thread."""
        twin = key.split("/")[1]
        robot = self._robots.get(twin)
        if robot is not None and key == _key(twin, _KEYS[kind]):  # a key with a wildcard is no robot's
            receive_setpoint(robot, kind, self._loop, payload)

    def follow(self, robot: LocalRobot) -> None:
        """Pass its leader's joint positions to a robot that has one; it may appear later, anywhere."""
        if robot.config.follows is None:
            return
        leader = str(robot.config.follows)
        unsubscribe = self._reports.subscribe_many(*_followed(robot, leader, self._loop))
        # A session does not receive its own publications.
        followers, follower = self._followers.setdefault(leader, []), _beside(robot, self._loop)
        followers.append(follower)

        def end() -> None:
            followers.remove(follower)
            unsubscribe()

        self._followed[robot.twin] = end


def receive_setpoint(robot: LocalRobot, kind: Kind, loop: asyncio.AbstractEventLoop, payload: bytes) -> None:
    """Receive a setpoint for a robot; on the bus's thread."""
    request = robot.read(kind, payload, transport=Transport.BUS)
    if request is not None:
        loop.call_soon_threadsafe(request, robot.requests.log_refusal)


def _beside(robot: LocalRobot, loop: asyncio.AbstractEventLoop) -> Callable[[JointReport], None]:
    """Return a receiver for a leader in this process; call_soon, so that the leader's tick is not delayed."""

    def on_report(report: JointReport) -> None:
        loop.call_soon(robot.follow, report)

    return on_report


def _followed(
    robot: LocalRobot, leader: str, loop: asyncio.AbstractEventLoop
) -> tuple[str, dict[str, Callable[[bytes], None]]]:
    """Return a leader's key and the subscriber for a robot that follows it."""

    def arrived(payload: bytes) -> None:
        try:
            report = decode_report(_LEADER, payload)
        except WireError as error:
            refusal = Reply(JOINT_TARGETS, ReplyStatus.REJECTED, f"its leader cannot be read: {error}")
            loop.call_soon_threadsafe(robot.requests.log_refusal, refusal)
            return
        if isinstance(report, JointReport):
            loop.call_soon_threadsafe(robot.follow, report)

    key = _key(leader, _LEADER)
    return key, {key: arrived}


def _key(twin: str, channel: str) -> str:
    """Return the key of a twin's channel; ``*`` for all twins."""
    return f"cw/{twin}/data/{channel}"
