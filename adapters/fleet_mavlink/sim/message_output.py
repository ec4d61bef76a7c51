"""Output of a simulated autopilot: texts in chunks, acknowledgements that may get lost, delayed messages."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.command_request import CommandRequest, ack

_TEXT = 50  # bytes in one STATUSTEXT
CRITICAL, WARNING, INFO = 2, 4, 6  # severities


class MessageOutput:
    """Output of an autopilot: ``out`` has the unsent messages, oldest first; ``time`` is now, s."""

    ends_text: ClassVar[str] = ""
    text_id_always: ClassVar[bool] = False
    ack_delay: ClassVar[float] = 0.0
    ack_queue: ClassVar[int] = 1000

    def __init__(self, rng: random.Random, faults: Mapping[str, float], now: float) -> None:
        self.random = rng
        self.faults = faults
        self.time = now
        self.out: list[object] = []
        self._later: list[tuple[float, object]] = []
        self._text_id = 0
        self._reported: set[str] = set()

    def say(self, severity: int, text: str) -> None:
        """Send a STATUSTEXT, in chunks if it is too long for one."""
        data = (text + self.ends_text).encode()
        number = 0
        if self.text_id_always or len(data) > _TEXT:
            self._text_id += 1
            number = self._text_id
        for chunk, start in enumerate(range(0, len(data), _TEXT)):
            part = data[start : start + _TEXT]
            self.out.append(mav.MAVLink_statustext_message(severity, part, number, chunk))

    def send_text_once(self, severity: int, text: str) -> None:
        """Send a STATUSTEXT only the first time after boot."""
        if text not in self._reported:
            self._reported.add(text)
            self.say(severity, text)

    def later(self, delay: float, message: object) -> None:
        """Send a message after a delay."""
        self._later.append((self.time + delay, message))

    def acknowledge(self, request: CommandRequest, result: int) -> None:
        """Acknowledge a command, unless a fault or the autopilot's short queue loses the answer."""
        if "no_ack" in self.faults or self.random.random() < self.faults.get("ack_loss", 0.0):
            return
        delay = self.ack_delay
        slow = self.faults.get("slow_ack", 0.0)
        if slow:
            self.out.append(ack(request, mav.MAV_RESULT_IN_PROGRESS, 10))
            delay += slow
        if len(self._later) >= self.ack_queue:
            return
        if delay:
            self.later(delay, ack(request, result))
        else:
            self.out.append(ack(request, result))

    def send_due_texts(self) -> None:
        """Send the delayed messages that are due."""
        if not self._later:
            return
        self.out.extend(message for due, message in self._later if due <= self.time)
        self._later = [entry for entry in self._later if entry[0] > self.time]
