"""RoboClaw motor controllers: one profile and one codec for a wheeled base.

Packet serial: address, command, big-endian arguments, CRC-16 (XMODEM) over all of them. A write command is
acknowledged with 0xFF; a read command is answered with the value and a CRC over request and value. Answers
have no header: they are matched to the requests in order, and a wrong CRC discards all pending requests. The
dead-man (command 14, steps of 100 ms) is off in a new controller: the adapter sets it and reads it back
before it drives the base. Written from the protocol's description, not tried on a controller.
"""

from __future__ import annotations

import binascii
import struct
from collections import deque
from collections.abc import Sequence
from typing import ClassVar, Literal

from pydantic import Field

from fleet import Limits
from fleet_ugv import (
    THREE_LITHIUM,
    BaseProfile,
    Codec,
    CodecSettings,
    Confirmed,
    Feedback,
    Motion,
    UgvAdapter,
    UgvConfig,
    UgvEvent,
    Wheels,
)

ADDRESS = 0x80
SET_TIMEOUT, GET_TIMEOUT, GET_VOLTS, SPEEDS, COUNTERS = 14, 15, 24, 37, 78
ANSWERS = {GET_TIMEOUT: 3, GET_VOLTS: 4, COUNTERS: 10}  # bytes, including the CRC
TAKEN = b"\xff"
MOST_REQUESTED = 8  # requests without an answer; more mean that the controller is gone
COUNTER = 2**32


def packet(command: int, arguments: bytes = b"") -> bytes:
    """Return a packet with its CRC."""
    body = bytes((ADDRESS, command)) + arguments
    return body + binascii.crc_hqx(body, 0).to_bytes(2)


class RoboclawCodec(Codec):
    """Codec of one controller; ``ticks`` per metre, ``timeout`` of its dead-man in s."""

    stop: ClassVar[bytes] = packet(SPEEDS, bytes(8))

    def __init__(self, *, ticks: float, timeout: float) -> None:
        self.garbage = 0
        self._ticks = ticks
        self._steps = max(1, round(timeout * 10))
        self._rest = b""
        self._requested: deque[int] = deque(maxlen=MOST_REQUESTED)
        self._volts: float | None = None

    def feed(self, data: bytes) -> Sequence[UgvEvent]:
        """Decode received bytes; return the events of the complete answers."""
        self._rest = (self._rest + data)[-256:]
        events: list[UgvEvent] = []
        while self._rest and (not self._requested or len(self._rest) >= ANSWERS[self._requested[0]]):
            said = self._next()
            if said is not None:
                events.append(said)
        return events

    def _next(self) -> UgvEvent | None:
        """Decode the answer to the oldest request, or an acknowledgement; discard anything else."""
        if self._requested:
            command = self._requested[0]
            answer = self._rest[: ANSWERS[command]]
            if self._is_good(command, answer):
                self._requested.popleft()
                self._rest = self._rest[len(answer) :]
                return self._answer(command, answer)
        if self._rest[:1] == TAKEN:
            self._rest = self._rest[1:]
            return None
        self.garbage += 1
        self._rest = b""
        self._requested.clear()
        return None

    def _is_good(self, command: int, answer: bytes) -> bool:
        """Return True for an answer with a valid CRC."""
        requested = bytes((ADDRESS, command))
        return binascii.crc_hqx(requested + answer[:-2], 0) == int.from_bytes(answer[-2:])

    def _answer(self, command: int, answer: bytes) -> UgvEvent | None:
        """Return the event of an answer."""
        if command == COUNTERS:
            left, right = struct.unpack(">ii", answer[:8])
            return Feedback(distances=(left / self._ticks, right / self._ticks), voltage=self._volts)
        if command == GET_VOLTS:
            self._volts = int.from_bytes(answer[:2]) / 10
            return None
        return Confirmed() if answer[0] == self._steps else None

    def _request(self, command: int) -> bytes:
        """Return a request, which has no CRC, and remember it."""
        self._requested.append(command)
        return bytes((ADDRESS, command))

    def motion(self, motion: Motion) -> bytes:
        """Return the command with the speeds of both motors in ticks per second."""
        assert isinstance(motion, Wheels)
        ticks = (round(speed * self._ticks) for speed in (motion.left, motion.right))
        return packet(SPEEDS, struct.pack(">ii", *(min(max(count, -(2**31)), 2**31 - 1) for count in ticks)))

    def setup(self) -> bytes:
        """Return the command that sets the dead-man, and the request that reads it back."""
        self._requested.clear()
        return packet(SET_TIMEOUT, bytes((self._steps,))) + self._request(GET_TIMEOUT)

    def poll(self) -> bytes:
        """Return the requests for voltage and counters."""
        return self._request(GET_VOLTS) + self._request(COUNTERS)


def _codec(setting: CodecSettings) -> Codec:
    """Return the codec of a robot."""
    return RoboclawCodec(ticks=setting.ticks, timeout=setting.timeout)


ROBOCLAW = BaseProfile(
    codec=_codec,
    baud=115200,
    track=0.30,
    diameter=0.12,
    fastest=1.5,
    limits=Limits(speed=1.0, yaw_rate=2.0),
    timeout=0.5,
    settable=True,
    poll=0.05,
    ticks=4000.0,
    counter=COUNTER,
    curve=THREE_LITHIUM,
)


class RoboclawConfig(UgvConfig):
    """Config of a base with a RoboClaw."""

    adapter: Literal["roboclaw"]  # type: ignore[assignment]
    profile: str = Field("roboclaw", description="What the base is: roboclaw.")

    @classmethod
    def profiles(cls) -> dict[str, BaseProfile]:
        """Return the one profile."""
        return {"roboclaw": ROBOCLAW}


class Roboclaw(UgvAdapter):
    """Drives a base through a RoboClaw controller."""

    Config = RoboclawConfig
