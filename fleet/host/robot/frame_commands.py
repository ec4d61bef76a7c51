"""Commands of a FrameAdapter: writes their frames, and waits between them for reports of the robot."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import struct
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from fleet.adapter import FrameAdapter, Until
from fleet.commands import CommandSpec, arguments
from fleet.errors import LinkLost, NotReady, Refused
from fleet.link.latest_motion import MotionFrames
from fleet.link.motion_sender import MotionSender
from fleet.model.command import Command
from fleet.runtime.exception_barrier import failure_of

_BAD_DATA = (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, struct.error)
_log = logging.getLogger(__name__)


class FrameCommands:
    """Commands of one FrameAdapter on one open link; ``write`` writes frames without motion."""

    def __init__(
        self, inner: FrameAdapter[Any], motion: MotionSender, write: Callable[[Iterable[bytes]], None]
    ) -> None:
        self._inner = inner
        self._motion = motion
        self._write = write
        self._waiting: list[tuple[Until, asyncio.Future[None]]] = []

    async def perform(self, spec: CommandSpec, command: Command) -> None:
        """Write the frames of a declared command, and wait wherever it yields an ``Until``.

        Raises Refused, Unsupported or NotReady, and the error of an ``Until``.
        """
        turn = self._motion.turn  # taken first: a stop from here on drops the command's remaining frames
        steps = self._steps_of(spec, command)
        while True:
            frames, until = self._next_frames(steps, command)
            if spec.moves and frames:
                self._motion.carry_out(frames, turn)
            elif frames:
                self._ready(frames)
            if until is None:
                return
            await self._seen(until)

    def _steps_of(self, spec: CommandSpec, command: Command) -> Iterator[bytes | Until]:
        """Start the translation of a command."""
        with self._translating(command):
            return iter(getattr(self._inner, spec.method)(**arguments(spec, command.data)))

    def _next_frames(
        self, steps: Iterator[bytes | Until], command: Command
    ) -> tuple[MotionFrames, Until | None]:
        """Return the frames up to the next ``Until``, and that one; None at the end of the command."""
        frames: list[bytes] = []
        with self._translating(command):
            for step in steps:
                if isinstance(step, Until):
                    return tuple(frames), step
                frames.append(step)
        return tuple(frames), None

    @contextlib.contextmanager
    def _translating(self, command: Command) -> Iterator[None]:
        """Refuse a command whose data make the translation raise: that is the sender's error."""
        try:
            yield
        except _BAD_DATA as error:
            _log.warning("%s: %s cannot be encoded: %r", self._inner.config.name, command.name, error)
            raise Refused(f"{command.name} cannot be encoded: {error!r}", hint="check its data") from error

    async def _seen(self, until: Until) -> None:
        """Wait until a frame has satisfied the condition of a command."""
        if until.seen():
            return
        waiter = (until, asyncio.get_running_loop().create_future())
        self._waiting.append(waiter)
        try:
            await waiter[1]
        finally:
            self._waiting.remove(waiter)

    def decoded(self) -> None:
        """Resume commands whose condition the last frame satisfied."""
        for until, future in self._waiting:
            if future.done():
                continue
            try:
                if until.seen():
                    future.set_result(None)
            except Exception as error:  # noqa: BLE001 - a bug of the adapter fails its command
                future.set_exception(failure_of(error))

    def _ready(self, frames: MotionFrames) -> None:
        """Write frames of a command without motion."""
        try:
            self._write(frames)
        except LinkLost as error:
            raise NotReady(str(error), hint="the link is being opened again") from error
