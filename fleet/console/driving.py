"""The hold-to-move pad of one page: velocities to one robot while the stick is held, zero when released.

A velocity is a message of the kind ``motion`` in the operator's name, which the edge admits and holds for its
lease. So nothing here keeps a robot moving: when a page, a console or a link falls silent, the motion ends
with that lease at the latest. Closing a page ends it at once.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Mapping
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.console.requests import PageDriveRequest
from fleet.console.sessions import ConsoleUser
from fleet.model.command import Reply, ReplyStatus
from fleet.runtime.decoding import decode_json

ANSWER_WITHIN = 1.0  # s for the edge to answer a velocity

SendResult = Callable[[Mapping[str, object]], None]
"""Sends the answer to a velocity to the page; on the loop."""


class Driving:
    """Velocities of one page. ``session_to`` returns the session of an edge; ``send_result`` gets answers."""

    def __init__(
        self,
        operator: ConsoleUser,
        session_to: Callable[[str], ZenohSession | None],
        clock: Clock,
        send_result: SendResult,
    ) -> None:
        self._operator = operator
        self._session_to = session_to
        self._clock = clock
        self._send_result = send_result
        self._robot = ""  # that moves by this page, empty for none
        self._loop = asyncio.get_running_loop()

    def drive(self, requested: PageDriveRequest) -> None:
        """Send a velocity; if it is for another robot, first stop the previous one."""
        if self._robot and self._robot != requested.robot:
            self.end()
        self._send(requested)
        self._robot = "" if requested.is_zero else requested.robot

    def end(self) -> None:
        """Send zero to the robot that moves by this page, if any."""
        if self._robot:
            self._send(PageDriveRequest(0, self._robot))
            self._robot = ""

    def _send(self, requested: PageDriveRequest) -> None:
        """Send one velocity."""
        edge, _, name = requested.robot.rpartition("/")
        bus_session = self._session_to(edge)
        if bus_session is None:
            self._answered(requested.number, Reply("motion", ReplyStatus.REJECTED, "no edge is reached"))
            return
        velocity = {
            name: getattr(requested, name) for name in ("linear_x", "linear_y", "linear_z", "angular_z")
        }
        message = {**velocity, "session_id": self._operator.name, "timestamp": self._clock.time()}
        bus_session.request_later(
            keys.as_console(keys.command(edge, name), self._operator.permission.word, bus_session.identity),
            json.dumps(message, allow_nan=False).encode(),
            timeout=ANSWER_WITHIN,
            parameters={"kind": "motion"},
            on_answer=partial(self._arrived, requested.number),
            on_end=lambda: None,
        )

    def _arrived(self, number: int, data: bytes) -> None:
        """Handle an answer; on the bus's thread."""
        try:
            reply = decode_json(data, Reply)
        except msgspec.DecodeError as error:
            reply = Reply("motion", ReplyStatus.TIMEOUT, f"its answer cannot be read: {error}")
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._answered, number, reply)

    def _answered(self, number: int, reply: Reply) -> None:
        """Send the answer to the page."""
        self._send_result(
            {"type": "drove", "number": number, "status": reply.status.value, "reason": reply.reason}
        )
