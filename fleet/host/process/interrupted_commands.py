"""Tells of commands that were under way when an earlier process of this edge died.

Each has a line in the log and an event in the history. One that the cloud had asked for also gets its final
status there: nobody else would tell how it ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fleet.bridge.command_replies import RobotPort
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.event_reporter import robot_log
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity

WHY = "the edge was restarted meanwhile; how it ended is unknown"


def tell_interrupted_commands(
    process: RobotProcess,
    robots: Iterable[RobotPort],
    tell_cloud: Callable[[RobotPort, Reply], None] | None = None,
) -> None:
    """Tell how the commands of these robots ended that an earlier process had begun; each is told once.

    Call it before the robots start, here and in workers: the journal's file is one for all of them.
    ``tell_cloud`` publishes the final status of a command on its twin's topic.
    """
    ports = {robot.name: robot for robot in robots}
    for command in process.journal.take_interrupted(ports):
        text = f"{command.name} failed: {WHY}"
        robot_log(command.robot).warning("%s", text)
        way = Transport(command.way)
        event = EventReport(
            process.clock.time(),
            EventKind.OUTCOME,
            text,
            Severity.WARNING,
            Requester(way),
            command.name,
            command.identity,
        )
        process.history.add(command.robot, event)
        if way is Transport.CLOUD and tell_cloud is not None:
            tell_cloud(ports[command.robot], Reply(command.name, ReplyStatus.TIMEOUT, WHY, done=False))
