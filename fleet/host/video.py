"""``start_video`` and ``stop_video``, passed on to the program on the bus that sends a robot's video.

The host sends none itself. A robot whose adapter declares these commands is asked like for any other.
"""

from __future__ import annotations

import asyncio

from fleet.bus import keys
from fleet.bus.lane import Lane
from fleet.clock import Clock
from fleet.errors import Refused, TimedOut, WireError
from fleet.host.local import LocalRobot
from fleet.host.ticket import Ticket
from fleet.model.command import Command
from fleet.wire.video import VIDEO_TYPES, read_video_reply, video_request

ANSWER_WITHIN = 4.0  # s that a program has; who asks by MQTT waits 5 s for us
START = "start one on the robot's computer: fleet video"


class VideoRelay:
    """Asks the programs that send one robot's video; on the loop."""

    def __init__(
        self, robot: str, key: str, lane: Lane, loop: asyncio.AbstractEventLoop, clock: Clock
    ) -> None:
        self._robot = robot
        self._key = key
        self._lane = lane
        self._loop = loop
        self._clock = clock

    def take(self, ask: Command, ticket: Ticket) -> None:
        """Pass a command on: it is done once a program says so, and refused when none is there to take it."""
        refusals: list[str] = []
        asked = self._clock.monotonic()

        def answered(payload: bytes) -> None:
            self._loop.call_soon_threadsafe(self._answered, payload, ticket, refusals)

        def ended() -> None:
            self._loop.call_soon_threadsafe(self._ended, asked, ticket, refusals)

        request = video_request(ask)
        self._lane.ask_later(self._key, request, timeout=ANSWER_WITHIN, on_answer=answered, on_end=ended)

    def _answered(self, payload: bytes, ticket: Ticket, refusals: list[str]) -> None:
        """Take one program's answer; there may be one for each camera, of which one takes what is asked."""
        try:
            reply = read_video_reply(payload)
        except WireError as error:
            refusals.append(f"the program that sends its video answers what cannot be read: {error}")
            return
        if reply.ok:
            ticket.done()
        else:
            refusals.append(reply.reason)

    def _ended(self, asked: float, ticket: Ticket, refusals: list[str]) -> None:
        """Tell who asked when no program has done it."""
        if ticket.receipt is not None:
            return
        if refusals:
            ticket.fail(Refused("; ".join(refusals)))
        elif self._clock.monotonic() - asked < ANSWER_WITHIN / 2:
            ticket.reject(
                f"no program on the bus sends video of {self._robot}", hint=f"{START} {self._robot}"
            )
        else:
            ticket.fail(TimedOut(f"the program that sends video of {self._robot} does not answer"))


def relay_video(
    robot: LocalRobot, edge: str, lane: Lane, loop: asyncio.AbstractEventLoop, clock: Clock
) -> None:
    """Have a robot's commands for video passed on, those that its adapter does not take itself."""
    relay = VideoRelay(robot.name, keys.video(edge, robot.name), lane, loop, clock)
    for name in VIDEO_TYPES:
        if not robot.takes(name):
            robot.desk.own[name] = relay.take
