"""The shell that runs a FrameAdapter as an Adapter: link, cutting, hello, tick, repeat, silence, stop.

A FrameAdapter only translates. Here its frames are written and what arrives is handed to it. ``halt`` may
come from another thread while the loop is inside the translation, so each write asks first whether a halt
came in between: nothing that was decided before a halt is written after it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import struct
import threading
from collections.abc import Iterable
from typing import Any

from fleet.adapter import Adapter, FrameAdapter, Robot, Send
from fleet.commands import CommandSpec, arguments
from fleet.errors import Fault, LinkLost, NotReady, Refused
from fleet.link.base import Address, Link
from fleet.link.framing import Cutter
from fleet.link.url import open_link, parse
from fleet.model.command import Command
from fleet.model.geometry import Velocity
from fleet.model.health import Health, Level
from fleet.model.report import Report

_STOP_REPEATS = 5  # times that a stop or a zero velocity is repeated, in case the line lost it
_BAD_DATA = (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, struct.error)
_log = logging.getLogger(__name__)


class Framed(Adapter[Any]):
    """One FrameAdapter and its link; raises LinkRefused for a bad ``link``, Fault when it cannot halt."""

    def __init__(self, inner: FrameAdapter[Any]) -> None:
        super().__init__(inner.config)
        self.inner = inner
        self._last_resort = tuple(inner.halt())
        if not self._last_resort:
            raise Fault(f"{type(inner).__name__}.halt() yields no frame", hint="a robot must be stoppable")
        # One that listens does not know whom to greet until the robot speaks.
        self._robot_speaks_first = parse(inner.config.link).scheme == "udpin"
        self._lock = threading.Lock()  # held for sends only, which never block
        self._turn = 0  # counts drives, stops and halts
        self._wanted: Velocity | None = None  # None: stopped
        self._repeats = 0  # left of what is not motion
        self._link: Link | None = None
        self._peer: Address = None
        self._session: _Session | None = None

    async def run(self, robot: Robot) -> None:
        """Open the link and serve it; raises LinkLost, LinkRefused, or what the translation raised."""
        session = _Session(self, robot)
        link = await open_link(self.config.link, session.arrived)
        try:
            self._link = link
            if not self._robot_speaks_first:
                self.write(self.inner.hello())
            session.begin()
            await _first_failure(link.lost(), session.failure)
        finally:
            self.halt()
            self._link = None
            await link.close()

    def write(self, frames: Iterable[bytes]) -> None:
        """Write frames that are not motion; raises LinkLost when the link is gone."""
        ready = tuple(frames)
        with self._lock:
            self._send(ready)

    def _send(self, frames: tuple[bytes, ...]) -> None:
        """Write with the lock held."""
        if self._link is None:
            raise LinkLost(f"{self.config.link}: not open")
        for frame in frames:
            self._link.send(frame, self._peer)

    def greet(self, address: Address) -> bool:
        """Return True for what comes from the robot; the first to speak on the link is the robot."""
        if address is None or address == self._peer:
            return True
        if self._peer is not None:
            return False
        self._peer = address
        if self._robot_speaks_first:
            self.write(self.inner.hello())
        return True

    def drive(self, velocity: Velocity) -> None:
        """Write this velocity and go on repeating it; raises NotReady without a link."""
        turn = self._turn
        frames = tuple(self.inner.encode(velocity))
        self._write_motion(turn, frames, velocity, _STOP_REPEATS if velocity.is_zero else 0)

    async def perform(self, spec: CommandSpec, command: Command) -> None:
        """Write the frames of a declared command; raises Refused, Unsupported or NotReady."""
        turn = self._turn
        frames = self._frames_of(spec, command)
        if spec.moves:
            self._write_motion(turn, frames, None, 0)
        else:
            self._ready(frames)

    def _frames_of(self, spec: CommandSpec, command: Command) -> tuple[bytes, ...]:
        """Translate a command; what its data makes the translation raise is the asker's fault."""
        try:
            if spec.method == "encode":
                return tuple(self.inner.encode(command))
            return tuple(getattr(self.inner, spec.method)(**arguments(spec, command.data)))
        except _BAD_DATA as error:
            _log.warning("%s: %s cannot be encoded: %r", self.config.name, command.name, error)
            raise Refused(f"{command.name} cannot be encoded: {error!r}", hint="check its data") from error

    def _ready(self, frames: tuple[bytes, ...]) -> None:
        """Write frames of a command that moves nothing."""
        try:
            self.write(frames)
        except LinkLost as error:
            raise NotReady(str(error), hint="the link is being opened again") from error

    def _write_motion(
        self, turn: int, frames: tuple[bytes, ...], wanted: Velocity | None, repeats: int
    ) -> None:
        """Write what was translated in ``turn``, unless a halt or a newer velocity came in between."""
        with self._lock:
            if turn != self._turn:
                raise NotReady("the robot was stopped meanwhile")
            try:
                self._send(frames)
            except LinkLost as error:
                raise NotReady(str(error), hint="the link is being opened again") from error
            self._turn += 1
            self._wanted = wanted
            self._repeats = repeats

    def repeat(self) -> None:
        """Write the last velocity again, or a stop for a few times; raises LinkLost."""
        turn, wanted = self._turn, self._wanted
        moving = wanted is not None and not wanted.is_zero
        if not moving and self._repeats == 0:
            return
        frames = self._halt_frames() if wanted is None else tuple(self.inner.encode(wanted))
        with self._lock:
            if turn == self._turn:
                self._send(frames)
                self._repeats -= 0 if moving else 1

    async def stop(self, reason: str) -> None:
        """Write the safe-stop frames, now and a few times more."""
        _log.info("%s: stop: %s", self.config.name, reason)
        self.halt()

    def halt(self) -> None:
        """Write the safe-stop frames at once and forget the velocity; from any thread."""
        frames = self._halt_frames()
        with self._lock:
            self._turn += 1
            self._wanted = None
            self._repeats = _STOP_REPEATS
            with contextlib.suppress(LinkLost):  # then the robot's own fail-safe stops it
                self._send(frames)

    def _halt_frames(self) -> tuple[bytes, ...]:
        """Return fresh stop frames, or those of the start: a bug must not keep a robot moving."""
        try:
            return tuple(self.inner.halt()) or self._last_resort
        except Exception:  # noqa: BLE001 - whatever it raises, the robot must stop
            _log.exception("%s: halt() raised; its first frames are used", self.config.name)
            return self._last_resort


class _Session:
    """One opened link of a Framed: what arrives, what is due, and the first failure of either."""

    def __init__(self, framed: Framed, robot: Robot) -> None:
        self.failure: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._framed = framed
        self._inner = framed.inner
        self._robot = robot
        self._cutter: Cutter = framed.inner.framing.cutter()
        self._heard = robot.clock.monotonic()
        self._understood = False

    def begin(self) -> None:
        """Ask the host's wheel for what is due from time to time."""
        inner = self._inner
        if inner.drives:
            self._robot.every(inner.repeat, self._framed.repeat)
        self._robot.every(inner.tick_every, self._tick)
        if inner.silence > 0:
            self._robot.every(inner.silence / 4, self._listen)
            self._robot.health(Health(Level.OFFLINE, "the link is open, the robot has not spoken yet"))
        else:
            self._robot.health(Health())

    def _tick(self) -> None:
        """Write keep-alives and polls."""
        self._framed.write(self._inner.tick())

    def _listen(self) -> None:
        """Notice a robot that has gone silent; raises LinkLost."""
        quiet = self._robot.clock.monotonic() - self._heard
        if quiet > self._inner.silence:
            raise LinkLost(f"{self._framed.config.link}: nothing heard for {quiet:.1f} s")

    def arrived(self, data: bytes, address: Address) -> None:
        """Take what the link received; a failure of the translation ends the run, not the loop."""
        try:
            if not self.failure.done() and self._framed.greet(address):
                for frame in self._cutter.feed(data):
                    self._decoded(frame)
        except Exception as error:  # noqa: BLE001 - handed to ``run``, which raises it
            self.failure.set_exception(error)

    def _decoded(self, frame: bytes) -> None:
        """Report or answer what one frame says."""
        self._heard = self._robot.clock.monotonic()
        for said in self._inner.decode(frame, self._robot.clock.time()):
            self._say(said)
            if not self._understood:
                self._understood = True
                self._robot.health(Health())

    def _say(self, said: Report | Send) -> None:
        """Publish a report, or write an answer."""
        if isinstance(said, Send):
            self._framed.write((said.frame,))
        else:
            self._robot.report(said)


async def _first_failure(lost: Any, failure: asyncio.Future[None]) -> None:
    """Wait for either, and raise what it raises."""
    losing = asyncio.ensure_future(lost)
    try:
        done, _ = await asyncio.wait({losing, failure}, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        losing.cancel()
        failure.cancel()
        await asyncio.gather(losing, failure, return_exceptions=True)
