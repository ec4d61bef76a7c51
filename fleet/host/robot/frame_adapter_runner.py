"""Runs a FrameAdapter as an Adapter: link, framing, hello, tick, motion, silence.

A FrameAdapter only translates; its frames are written here, and received bytes are passed to it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Mapping
from typing import Any

from fleet.adapter import Adapter, FrameAdapter, Robot, Send
from fleet.commands import CommandSpec
from fleet.errors import Fault, LinkLost
from fleet.host.robot.frame_commands import FrameCommands
from fleet.link.base import Address, Link
from fleet.link.framing import Framer
from fleet.link.latest_motion import LatestMotion, MotionFrames
from fleet.link.motion_sender import POLL_INTERVAL, MotionSender
from fleet.link.url import opened_link, parse_link_url
from fleet.model.command import Command
from fleet.model.geometry import Velocity
from fleet.model.health import Health, Level
from fleet.model.joints import JointRange
from fleet.model.report import Report
from fleet.runtime.exception_barrier import failure_of, failure_text

_log = logging.getLogger(__name__)


class FrameAdapterRunner(Adapter[Any]):
    """One FrameAdapter and its link; raises LinkRefused for a bad ``link``, Fault when it cannot halt."""

    def __init__(self, inner: FrameAdapter[Any], robot: Robot) -> None:
        super().__init__(inner.config, robot)
        self.inner = inner
        self.failsafe = inner.failsafe
        self._last_resort = tuple(inner.halt())
        if not self._last_resort:
            raise Fault(f"{type(inner).__name__}.halt() yields no frame", hint="a robot must be stoppable")
        # A listening socket has no peer address until the robot speaks.
        self._robot_speaks_first = parse_link_url(inner.config.link).scheme == "udpin"
        self._peer: Address = None
        self._halt_failure: BaseException | None = None  # what the latest call of ``inner.halt`` raised
        self._session: _OpenLink
        self._link: Link
        self._slot: LatestMotion
        self._motion: MotionSender
        self._commands: FrameCommands

    async def connect(self) -> None:
        """Open the link and send the hello; raises LinkLost or LinkRefused."""
        url, self._session = self.config.link, _OpenLink(self)
        self._link = await self.robot.enter(opened_link(url, self._session.arrived))
        self._slot = LatestMotion(self._link, self.robot.clock, baud=parse_link_url(url).baud)
        self._motion = MotionSender(
            self._slot, self.robot.clock, encode=self._encode, stop=self._halt_frames, every=self.inner.repeat
        )
        self._commands = FrameCommands(self.inner, self._motion, self.write)
        if not self._robot_speaks_first:
            self._leave_halt()
            self.write(self.inner.hello())
        self._session.begin(self._motion)

    async def run(self) -> None:
        """Serve the link; raises LinkLost, or the translation's error."""
        try:
            await _first_failure(self._link.lost(), self._session.failure)
        finally:
            self._motion.halt()

    def _leave_halt(self) -> None:
        """Register the halt frames with the supervisor."""
        self.robot.leave_halt(self._link, self._last_resort, self._peer)

    def write(self, frames: Iterable[bytes]) -> None:
        """Write frames that are not motion; raises LinkLost when the link is gone."""
        self._slot.send(*frames)

    @property
    def superseded(self) -> int:
        """Number of motions that a newer one replaced because the line was busy."""
        return self._slot.superseded

    def is_from_robot(self, address: Address) -> bool:
        """Return True for data from the robot; the first sender on the link is the robot."""
        if address is None or address == self._peer:
            return True
        if self._peer is not None:
            return False
        self._peer = self._slot.peer = address
        self._leave_halt()
        if self._robot_speaks_first:
            self.write(self.inner.hello())
        return True

    def drive(self, velocity: Velocity) -> None:
        """Write this velocity and keep repeating it; raises NotReady when the link is gone."""
        self._motion.drive(velocity)

    def _encode(self, velocity: Velocity) -> MotionFrames:
        """Translate a velocity."""
        return tuple(self.inner.drive(velocity))

    async def perform(self, spec: CommandSpec, command: Command) -> None:
        """Execute a declared command; raises as ``FrameCommands.perform``."""
        await self._commands.perform(spec, command)

    def decoded(self) -> None:
        """Resume commands that waited for the last frame."""
        self._commands.decoded()

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return the joints that take targets."""
        return self.inner.joint_ranges()

    def move_joints(self, targets: Mapping[str, float]) -> None:
        """Write joint targets; raises NotReady without a link, or after a halt meanwhile."""
        turn = self._motion.turn
        self._motion.carry_out(tuple(self.inner.encode_joints(targets)), turn)

    async def stop(self, reason: str) -> None:
        """Write the safe-stop frames, now and a few times more; raises LinkLost if the link takes none.

        Raises RuntimeError as ``halt`` does.
        """
        _log.info("%s: stop: %s", self.config.name, reason)
        self.halt_unheard(reason)
        self._require_sound_halt()

    def halt(self) -> None:
        """Write the safe-stop frames at once and drop the velocity; from any thread.

        Raises RuntimeError if the adapter's own ``halt`` raised, after the frames of its start were written.
        """
        self._motion.halt()
        self._require_sound_halt()

    def halt_unheard(self, reason: str) -> bool:  # noqa: ARG002 - every stop is the same
        """Write the safe-stop frames; raises LinkLost if the link does not take them."""
        if not self._motion.halt():
            raise LinkLost(
                f"{self.config.link} accepts no data: it is down, or nothing was received on it yet"
            )
        return True

    def _halt_frames(self) -> MotionFrames:
        """Return fresh stop frames, or those of the start: a bug must not keep a robot moving."""
        before, self._halt_failure = self._halt_failure, None
        try:
            return tuple(self.inner.halt()) or self._last_resort
        except BaseException as error:  # noqa: BLE001 - whatever it raises, the robot must stop
            self._halt_failure = error
            if before is None:  # a stop is repeated; the end of the run logs the traceback
                name, why = self.config.name, failure_text(error)
                _log.error("%s: halt() raised %s; the frames of its start are used", name, why)
            return self._last_resort

    def _require_sound_halt(self) -> None:
        """Raise RuntimeError if the latest call of the adapter's ``halt`` raised."""
        if (error := self._halt_failure) is not None:
            why = f"halt() raised {type(error).__name__}: {error}; the frames of its start were written"
            raise RuntimeError(why) from error


class _OpenLink:
    """Open link: received bytes, periodic work, and the first failure of either."""

    def __init__(self, framed: FrameAdapterRunner) -> None:
        self.failure: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._framed = framed
        self._inner = framed.inner
        self._robot = framed.robot
        self._framer: Framer = framed.inner.framing.framer()
        self._heard = 0.0
        self._early: list[tuple[bytes, Address]] | None = []  # data received before ``begin``
        self._understood = False
        self._slow = False

    def begin(self, motion: MotionSender) -> None:
        """Start the periodic calls, and process the data received while the link was being opened."""
        inner = self._inner
        self._heard = self._robot.clock.monotonic()  # opening the link may have taken long
        self._robot.every(POLL_INTERVAL, motion.poll)
        self._robot.every(inner.tick_every, self._tick)
        if inner.silence > 0:
            self._robot.every(inner.silence / 4, self._listen)
            self._robot.health(Health(Level.OFFLINE, "the link is open, the robot has not spoken yet"))
        else:
            self._robot.health(Health())
        early, self._early = self._early or [], None
        for data, address in early:
            self.arrived(data, address)

    def _tick(self) -> None:
        """Write keep-alives and polls; log once that the line is too slow."""
        self._framed.write(self._inner.tick())
        if self._framed.superseded and not self._slow:
            self._slow = True
            self._robot.log.warning("the line is slow: of several motions only the newest is written")

    def _listen(self) -> None:
        """Detect a silent robot; raises LinkLost."""
        quiet = self._robot.clock.monotonic() - self._heard
        if quiet > self._inner.silence:
            raise LinkLost(f"{self._framed.config.link}: nothing received for {quiet:.1f} s")

    def arrived(self, data: bytes, address: Address) -> None:
        """Process received data; an error of the translation ends the run, not the event loop."""
        if self._early is not None:
            self._early.append((data, address))
            return
        try:
            if not self.failure.done() and self._framed.is_from_robot(address):
                for frame in self._framer.feed(data):
                    self._decoded(frame)
        except BaseException as error:  # noqa: BLE001 - passed to ``run``, which raises it
            self.failure.set_exception(failure_of(error))

    def _decoded(self, frame: bytes) -> None:
        """Pass on the contents of one frame: reports, health or answers."""
        self._heard = self._robot.clock.monotonic()
        for said in self._inner.decode(frame, self._robot.clock.time()):
            self._say(said)
            if not self._understood:
                self._understood = True
                if not isinstance(said, Health):
                    self._robot.health(Health())
        self._framed.decoded()

    def _say(self, said: Report | Send | Health) -> None:
        """Publish a report or a health, or write an answer."""
        if isinstance(said, Send):
            self._framed.write((said.frame,))
        elif isinstance(said, Health):
            self._robot.health(said)
        else:
            self._robot.report(said)


async def _first_failure(lost: Any, failure: asyncio.Future[None]) -> None:
    """Wait for the first of the two to end, and raise its error."""
    losing = asyncio.ensure_future(lost)
    try:
        done, _ = await asyncio.wait({losing, failure}, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        losing.cancel()
        failure.cancel()
        await asyncio.gather(losing, failure, return_exceptions=True)
