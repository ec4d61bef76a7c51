"""Reports commands that were running when an earlier process of this edge died.

Each gets a line in the log and an event in the history. A command from the cloud also gets its final status
there, which no other part would send.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fleet.bridge.command_replies import RobotPort
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.event_reporter import robot_log
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity

WHY = "the edge was restarted meanwhile; how it ended is unknown"


def report_interrupted_commands(
    process: RobotProcess,
    robots: Iterable[RobotPort],
    tell_cloud: Callable[[RobotPort, Reply], None] | None = None,
) -> None:
    """Report the commands of these robots that an earlier process left without an end; each once.

    Call it before the robots start, here and in workers: all of them share the journal's file.
    ``tell_cloud`` publishes the final status of a command on its twin's topic.
    """
    ports = {robot.name: robot for robot in robots}
    for command in process.journal.take_interrupted(ports):
        text = f"{command.name} failed: {WHY}"
        robot_log(command.robot).warning("%s", text)
        transport = Transport(command.transport)
        event = EventReport(
            process.clock.time(),
            EventKind.OUTCOME,
            text,
            Severity.WARNING,
            Requester(transport),
            command.name,
            command.identity,
        )
        process.history.add(command.robot, event)
        if transport is Transport.CLOUD and tell_cloud is not None:
            tell_cloud(ports[command.robot], Reply(command.name, ReplyStatus.TIMEOUT, WHY, done=False))
