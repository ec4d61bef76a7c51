"""The whole contract of a robot.

Two ways in: ``Adapter`` (async, for robots with their own brain or SDK) and ``FrameAdapter`` (no I/O at
all, for robots that speak frames over a link). What is declared neither by ``@command`` nor by
``drive`` or ``navigate`` is refused by the host before it reaches the adapter.

The host owns, for every robot alike: who may command, age, duplicates, limits, the control lease, the
dead-man, the latched emergency stop, action states, replies, rates, health. An adapter translates.
"""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager
from types import MappingProxyType
from typing import Any, ClassVar, Generic, ParamSpec, Protocol, TypeVar

import msgspec

from fleet.clock import Clock
from fleet.commands import CommandSpec, command, commands_of
from fleet.errors import Unsupported
from fleet.link.base import Address, Link
from fleet.link.framing import Framing, LineFraming
from fleet.link.tap import Redaction
from fleet.model.geometry import Velocity
from fleet.model.health import Health
from fleet.model.joints import JointRange
from fleet.model.navigation import Progress, Task
from fleet.model.report import Report
from fleet.robot_config import AdapterConfig, Limits, Separation
from fleet.simulation import Simulation, SimulationStart

__all__ = [
    "Adapter",
    "AdapterConfig",
    "FrameAdapter",
    "Robot",
    "Send",
    "command",
]

ConfigT = TypeVar("ConfigT", bound=AdapterConfig)
OpenT = TypeVar("OpenT")
ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")


class Robot(Protocol):
    """The host's side of one robot, given to its adapter for one attempt to run it.

    ``limits`` are those in force: the adapter's own, narrowed by fleet.yaml. ``state`` is a dictionary that
    survives attempts: what the next adapter of this robot must know, such as where odometry had come to. It
    is lost with the process.
    """

    name: str
    log: logging.Logger
    limits: Limits
    state: dict[str, Any]

    @property
    def clock(self) -> Clock:
        """The host's clock: ``monotonic()`` s, and ``time()``, Unix s, for the stamps of reports."""

    @property
    def emergency_stop(self) -> bool:
        """True while an emergency stop is set, which the host holds: for those who let others command it."""

    def report(self, report: Report) -> None:
        """Publish a report; of one channel only the newest until the next tick is kept.

        The first report of an attempt means that the robot answers, unless ``health`` has said otherwise.
        """

    def health(self, health: Health) -> None:
        """Say how the robot is. ``Health()`` (ok) means: it answers.

        OFFLINE: nothing can be asked of it. FAULT: it answers and has a fault that a person must look at; the
        host ends its motion and refuses more with these words, until another health comes. What does not move
        it, what is ``safe``, and stops are still let through. Whoever calls this in ``connect`` or ``run``
        says it all: reports and the return of ``connect`` change nothing any more.
        """

    def authority_lost(self, reason: str) -> None:
        """Somebody else took the robot (a pilot, another station): end all motion of ours."""

    def lacks(self, reasons: Mapping[str, str]) -> None:
        """Say what of the declared vocabulary this robot does not have, by name, with the reason.

        For an adapter of several kinds of robots. Names are those of commands, of verbs (``strafe_left``:
        such velocities are refused too), ``goto`` for goals and ``plan`` for missions. They are refused and
        no longer described. The last call counts; call it again when the robot changes.
        """

    def circles(self, radius: float) -> None:
        """Say that the robot cannot stand: where it ends or is stopped it circles, within ``radius`` metres.

        Its goals, fence, separation and battery reserve count the circle. 0: it stands, as it does while
        nothing was said. The last call counts; call it again when the robot changes.
        """

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:
        """Leave the frames that halt the robot with the supervisor: it writes them when this process dies.

        They go to ``link``, which the supervisor holds open as well until this attempt ends; ``address``: to
        whom, for datagrams. The robot must take them at any time. The last call counts. For a robot with a
        ``failsafe`` of its own this is sooner; for one without it is all that stops it.
        """

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Call back about every ``seconds`` on the host's wheel until this attempt ends.

        The call must not block; an exception it raises ends the attempt.
        """

    async def enter(self, context: AbstractAsyncContextManager[OpenT]) -> OpenT:
        """Enter a context for the rest of this attempt; the host leaves it after the robot was halted."""

    def share(
        self, key: str, make: Callable[[], AbstractAsyncContextManager[OpenT]]
    ) -> AbstractAsyncContextManager[OpenT]:
        """Return what ``make`` gives, to be entered; one per process for all robots that use the same key."""

    async def blocking(
        self, call: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs
    ) -> ResultT:
        """Make a call that blocks, as those of many SDKs do, on a thread of its own; return its result.

        Calls run side by side, so a stop is never queued behind one that hangs. Whoever waits may be
        cancelled; the call itself goes on to its end. Raises what the call raises, and NotReady while too
        many calls of this robot hang.
        """


ADAPTER_API = 1
"""The version of this API. An adapter written for another one is refused when it is loaded; a change that
breaks adapters raises it, and the version before is accepted, with a warning, for one minor release."""


class AdapterBase(ABC, Generic[ConfigT]):
    """The declarations that both kinds of adapter share."""

    Config: ClassVar[type[AdapterConfig]]
    api: ClassVar[int] = 1  # the version of this API that the adapter was written for, as in ADAPTER_API
    limits: ClassVar[Limits] = Limits()
    separation: ClassVar[Separation] = Separation(radius=1.0, braking=0.5, precedence=2)
    holonomic: ClassVar[bool] = False  # it also moves sideways; else such velocities are refused
    combines_keys: ClassVar[bool] = False  # verbs that are held together add up, opposite ones cancel
    tells_home: ClassVar[bool] = False  # it reports where on Earth its home is, which places it in the site
    replayed_channels: ClassVar[frozenset[str] | None] = None
    """The channels whose reports follow from recorded frames alone; None: all. The others are not compared
    when a recording is fed to the adapter."""
    replay_tolerance: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """By which share numbers may differ then, by the name of their member: those that are computed from the
    time at which frames were read, which is not recorded to the microsecond."""
    failsafe: str = ""
    """What of the robot's own ends its motion when this process dies, and after how long ("its firmware stops
    0.5 s after the last velocity"). Empty where nothing does: then leave a halt, or its health says so."""

    def drive(self, velocity: Velocity) -> Any:  # noqa: ARG002 - for overriders
        """Hold a body velocity; a robot whose adapter overrides this takes velocities."""
        raise Unsupported(f"{type(self).__name__} takes no velocities")

    @classmethod
    def commands(cls) -> Mapping[str, CommandSpec]:
        """Return the declared commands by name."""
        return commands_of(cls)

    @staticmethod
    def simulation(config: Any, start: SimulationStart) -> Simulation | None:  # noqa: ARG004 - for overriders
        """Return the simulated robot that takes the robot's place in a rehearsal.

        None: there is none that runs in simulated time, and a kinematic stand-in takes its place. Raises
        Refused where it cannot begin as the robot stands now.
        """
        return None

    @staticmethod
    def redaction() -> Redaction | None:
        """Return what overwrites the secrets in the bytes of one direction of one link, for recordings.

        It is given the bytes as they come, in pieces of any length, and returns as many each time. None: the
        robot is told no secrets. What it raises keeps these bytes out of the recording.
        """
        return None

    @classmethod
    def drives(cls) -> bool:
        """Return True when the robot takes velocities: ``drive`` is overridden."""
        return cls.drive not in {AdapterBase.drive, Adapter.drive, FrameAdapter.drive}


class Adapter(AdapterBase[ConfigT]):
    """One robot of one kind. The host makes a new one for each attempt to run it.

    Nothing is asked of it, not even a stop, before ``connect`` has returned, and nothing after the host has
    begun to close what was entered. So an attribute that ``connect`` sets is always there.
    """

    def __init__(self, config: ConfigT, robot: Robot) -> None:
        self.config = config
        self.robot = robot

    @classmethod
    def navigates(cls) -> bool:
        """Return True when the robot goes to goals by itself (``navigate`` is overridden)."""
        return cls.navigate is not Adapter.navigate

    @classmethod
    def moves_joints(cls) -> bool:
        """Return True when the robot takes joint targets (``move_joints`` is overridden)."""
        return cls.move_joints is not Adapter.move_joints

    @classmethod
    def connects(cls) -> bool:
        """Return True when there is something to connect to (``connect`` is overridden)."""
        return cls.connect is not Adapter.connect

    @staticmethod
    def replayed(config: Any, robot: Robot) -> Adapter[Any] | None:  # noqa: ARG004 - for overriders
        """Return the adapter that is given recorded frames; None: robots of this kind cannot be replayed.

        It must open links by ``open_link`` alone, which gives it recorded ones then, and reach nothing else;
        ``config`` has a recorded link, also where the robot was simulated.
        """
        return None

    async def connect(self) -> None:
        """Open the way to the robot; for an adapter that overrides it, its return means: the robot answers.

        Open with ``await self.robot.enter(...)``; the host closes. Raises LinkLost or LinkRefused for the
        link, Fault when a person must act. One that cannot tell yet whether the robot answers says so first:
        ``self.robot.health(Health(Level.OFFLINE, why))``.
        """

    async def run(self) -> None:
        """Serve the robot until it ends or raises; left out, until a periodic call raises.

        Raises LinkLost, LinkRefused or Fault as ``connect`` does. The host halts the robot while its link is
        still open, closes, backs off and makes a new adapter for whatever ends this.
        """
        await asyncio.Event().wait()

    def drive(self, velocity: Velocity) -> None:
        """Hold this body velocity from now on, until the next call or a stop; never blocks.

        The host has clamped it, and calls again with zero when its lease runs out.
        """
        super().drive(velocity)

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return the joints that take targets now, by name; what is not among them is refused.

        Each must be in a ``JointReport`` of the robot's: the host leads it from where it was measured.
        """
        return {}

    def move_joints(self, targets: Mapping[str, float]) -> None:  # noqa: ARG002 - for overriders
        """Have these joints (rad, or m) go there at once, and hold there; never blocks.

        The host calls it many times a second, no farther within its range than the joint's speed allows.
        """
        raise Unsupported(f"{type(self).__name__} takes no joint targets")

    def hold_joints(self) -> None:
        """Hold the joints where they are, because nobody leads them any more; bound like ``halt``.

        ``halt`` and ``stop`` must do it as well.
        """
        self.halt()

    @abstractmethod
    async def stop(self, reason: str) -> None:
        """Bring the robot to a safe standstill and hold it; never raises for a link that is gone.

        For an aircraft: brake and hold in the air, never cut motors. The host bounds it in time.
        """

    @abstractmethod
    def halt(self) -> None:
        """Write the safe-stop bytes at once; called from any thread, also while the loop is stuck.

        Must not block, must not touch the event loop, must never raise.
        """

    def emergency_halt(self) -> None:
        """Write the bytes of an emergency stop at once, where a robot has others; bound like ``halt``.

        ``stop("emergency_stop")`` follows on the event loop, as soon as that runs.
        """
        self.halt()

    def navigate(self, task: Task) -> AsyncIterator[Progress]:  # noqa: ARG002 - for overriders
        """Carry out a task, yielding progress; return when it is done, raise when it cannot be.

        The host cancels the iteration for stop, a newer goal, or teleoperation, and then stops the robot.
        """
        raise Unsupported(f"{type(self).__name__} does not navigate")


class Send(msgspec.Struct, frozen=True):
    """A frame that a FrameAdapter wants written in answer to one it decoded."""

    frame: bytes


class Until(msgspec.Struct, frozen=True):
    """A command of a FrameAdapter goes on once ``seen()`` is True; it is asked after each decoded frame.

    What the command yields after it is written then; after the last one, the command is done.
    """

    seen: Callable[[], bool]


class FrameAdapter(AdapterBase[ConfigT]):
    """A robot that speaks frames over a link: pure translation, no I/O, no clock, no task.

    ``Config`` must have a ``link`` field. The host opens it, cuts the bytes into frames by ``framing``,
    calls back, writes what is yielded, repeats the last velocity every ``repeat`` seconds while its lease
    lives, and calls ``tick`` every ``tick_every`` seconds. A command is a method marked ``@command`` that
    yields its frames, and ``Until`` where it has to wait for what the robot reports.
    """

    framing: ClassVar[Framing] = LineFraming()
    repeat: ClassVar[float] = 0.1
    tick_every: ClassVar[float] = 1.0
    silence: ClassVar[float] = 3.0  # s without a frame after which the link counts as lost; 0: never

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    def drive(self, velocity: Velocity) -> Iterable[bytes]:
        """Yield the frames that hold this body velocity; raise Refused with the reason."""
        raise Unsupported(f"{type(self).__name__} takes no velocities: {velocity}")

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return the joints that take targets; as an Adapter's. A robot that has some overrides both."""
        return {}

    def encode_joints(self, targets: Mapping[str, float]) -> Iterable[bytes]:  # noqa: ARG002 - for overriders
        """Yield the frames by which these joints (rad, or m) go there at once, and hold there.

        When nobody leads them any more, ``halt`` is written: it must hold them where they are.
        """
        raise Unsupported(f"{type(self).__name__} takes no joint targets")

    @abstractmethod
    def decode(self, frame: bytes, stamp: float) -> Iterable[Report | Send | Health]:
        """Yield what one frame says, measured at ``stamp`` (Unix s); nothing for noise.

        A ``Health`` counts until the next one; a robot that never yields one is ok while it is understood.
        """

    @abstractmethod
    def halt(self) -> Iterable[bytes]:
        """Yield the safe-stop frames; never empty, never raises."""

    def hello(self) -> Iterable[bytes]:
        """Yield the first words on a fresh link."""
        return ()

    def tick(self) -> Iterable[bytes]:
        """Yield keep-alives and polls."""
        return ()


AnyAdapter = Adapter[Any] | FrameAdapter[Any]
