"""The contract between the host and an adapter.

There are two base classes: ``Adapter`` (async, for robots with an onboard computer or an SDK) and
``FrameAdapter`` (pure, for robots that exchange frames over a link). The host refuses every request that the
adapter does not declare with ``@command``, ``drive`` or ``navigate``.

The host is responsible for permissions, age, duplicates, limits, the control lease, the dead-man, the latched
emergency stop, action states, replies, rates and health of every robot. An adapter translates.
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
from fleet.wire.stops import EMERGENCY

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
    """The host's interface to one robot, passed to its adapter for one attempt to run it.

    ``limits`` are the effective limits: the adapter's own, narrowed by fleet.yaml. ``state`` is a dictionary
    that survives attempts, for values such as the last odometry pose. It is lost with the process.
    """

    name: str
    log: logging.Logger
    limits: Limits
    state: dict[str, Any]

    @property
    def clock(self) -> Clock:
        """The host's clock: ``monotonic()`` in s, and ``time()`` in Unix s for the stamps of reports."""

    @property
    def emergency_stop(self) -> bool:
        """True while the host holds an emergency stop; for adapters whose robot also obeys other senders."""

    def report(self, report: Report) -> None:
        """Publish a report. Between two ticks only the newest report of a state channel is kept.

        The first report of an attempt marks the robot as online, unless ``health`` has been called before.
        """

    def health(self, health: Health) -> None:
        """Set the health of the robot. ``Health()`` (ok) means that the robot answers.

        OFFLINE: the robot cannot be reached. FAULT: it answers, but needs a person; the host ends its motion
        and refuses further motion with this text until the next call. Stops and commands that are ``safe`` or
        do not move the robot still pass. After a call in ``connect`` or ``run``, reports and the return of
        ``connect`` no longer change the health.
        """

    def authority_lost(self, reason: str) -> None:
        """Report that a pilot or another station took control: the host ends all motion that it commanded."""

    def lacks(self, reasons: Mapping[str, str]) -> None:
        """Declare the parts of the vocabulary that this robot does not support, with a reason for each name.

        For adapters of several kinds of robots. A name is that of a command, of a motion verb
        (``strafe_left``: velocities in this direction are refused too), ``goto`` for goals or ``plan`` for
        missions. The host refuses these and no longer describes them. Each call replaces the one before; call
        it again when the robot changes.
        """

    def circles(self, radius: float) -> None:
        """Declare that the robot cannot stand still, but circles within ``radius`` metres when it stops.

        Its goals, fence, separation and battery reserve include the circle. 0, the default: it stands still.
        Each call replaces the one before; call it again when the robot changes.
        """

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:
        """Register the frames that halt the robot; the supervisor writes them when this process dies.

        They are written to ``link``, which the supervisor keeps open as well until this attempt ends, and to
        ``address`` on a datagram link. The robot must accept them at any time. Each call replaces the one
        before. A robot with a ``failsafe`` of its own stops sooner with them; a robot without one stops only
        by them.
        """

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Call ``call`` about every ``seconds`` on the host's tick scheduler until this attempt ends.

        The call must not block; an exception that it raises ends the attempt.
        """

    async def enter(self, context: AbstractAsyncContextManager[OpenT]) -> OpenT:
        """Enter a context for the rest of this attempt; the host exits it after it has halted the robot."""

    def share(
        self, key: str, make: Callable[[], AbstractAsyncContextManager[OpenT]]
    ) -> AbstractAsyncContextManager[OpenT]:
        """Return the context of ``make``, shared by all robots of the process that use the same key."""

    async def blocking(
        self, call: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs
    ) -> ResultT:
        """Make a blocking call, as of an SDK, on a thread of its own; return its result.

        Calls run concurrently, so a stop never queues behind a call that hangs. Cancelling the caller does
        not end the call. Raises the exception of the call, and NotReady while too many calls of this robot
        hang.
        """


ADAPTER_API, OLDEST_ADAPTER_API = 1, 1
"""The version of this API, and the oldest that is accepted, with a warning; others are refused when loaded.

A breaking change increments the first number; one minor release later the second one follows.
"""


class AdapterBase(ABC, Generic[ConfigT]):
    """The declarations that both kinds of adapter share."""

    Config: ClassVar[type[AdapterConfig]]
    api: ClassVar[int] = 1  # the version of this API that the adapter is written for, see ADAPTER_API
    limits: ClassVar[Limits] = Limits()
    separation: ClassVar[Separation] = Separation(radius=1.0, braking=0.5, precedence=2)
    # True: the robot also moves sideways; otherwise such velocities are refused
    holonomic: ClassVar[bool] = False
    combines_keys: ClassVar[bool] = False  # motion verbs held together add up, opposite verbs cancel out
    # the adapter reports the geodetic position of its home, which places the robot in the site
    tells_home: ClassVar[bool] = False
    replayed_channels: ClassVar[frozenset[str] | None] = None
    """The channels whose reports depend on recorded frames only; None: all of them.

    The other channels are not compared when a recording is replayed through the adapter.
    """
    replay_tolerance: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Relative tolerance of numbers in a replay, by the name of their field.

    For numbers computed from the time at which frames were read, which is not recorded to the microsecond.
    """
    failsafe: str = ""
    """The robot's own mechanism that ends its motion when this process dies, with its delay.

    For example "its firmware stops 0.5 s after the last velocity". Leave it empty if there is none: then
    register a halt, or the robot's health reports that nothing stops it.
    """

    def drive(self, velocity: Velocity) -> Any:  # noqa: ARG002 - for overriders
        """Hold a body velocity. A robot accepts velocities if its adapter overrides this method."""
        raise Unsupported(f"{type(self).__name__} takes no velocities")

    @classmethod
    def commands(cls) -> Mapping[str, CommandSpec]:
        """Return the declared commands by name."""
        return commands_of(cls)

    @staticmethod
    def simulation(config: Any, start: SimulationStart) -> Simulation | None:  # noqa: ARG004 - for overriders
        """Return the simulated robot that replaces the robot in a rehearsal.

        None: there is no simulation in simulated time, and a kinematic stand-in is used. Raises Refused if
        the simulation cannot begin from the robot's present state.
        """
        return None

    @staticmethod
    def redaction() -> Redaction | None:
        """Return a function that overwrites secrets in recorded bytes; called for one direction of one link.

        It receives the bytes in pieces of any length and returns the same number of bytes each time. None:
        the robot exchanges no secrets. If the function raises, these bytes are left out of the recording.
        """
        return None

    @classmethod
    def drives(cls) -> bool:
        """Return True if the robot accepts velocities, that is, if ``drive`` is overridden."""
        return cls.drive not in {AdapterBase.drive, Adapter.drive, FrameAdapter.drive}


class Adapter(AdapterBase[ConfigT]):
    """One robot of one kind. The host creates a new adapter for each attempt to run it.

    The host calls no other method before ``connect`` has returned, not even a stop, and none after it has
    begun to close the entered contexts. An attribute set in ``connect`` is therefore always there.
    """

    def __init__(self, config: ConfigT, robot: Robot) -> None:
        self.config = config
        self.robot = robot

    @classmethod
    def navigates(cls) -> bool:
        """Return True if the robot goes to goals by itself (``navigate`` is overridden)."""
        return cls.navigate is not Adapter.navigate

    @classmethod
    def moves_joints(cls) -> bool:
        """Return True if the robot accepts joint targets (``move_joints`` is overridden)."""
        return cls.move_joints is not Adapter.move_joints

    @classmethod
    def connects(cls) -> bool:
        """Return True if the adapter has a connection to open (``connect`` is overridden)."""
        return cls.connect is not Adapter.connect

    @staticmethod
    def replayed(config: Any, robot: Robot) -> Adapter[Any] | None:  # noqa: ARG004 - for overriders
        """Return the adapter that receives recorded frames; None: robots of this kind cannot be replayed.

        It must open links by ``open_link`` only, which then returns recorded links, and use no other
        resource. The ``config`` has a recorded link, also for a robot that was simulated.
        """
        return None

    async def connect(self) -> None:
        """Open the connection to the robot. If overridden, its return means that the robot answers.

        Open resources with ``await self.robot.enter(...)``; the host closes them. Raises LinkLost or
        LinkRefused for the link, and Fault if a person must act. An adapter that does not know yet whether
        the robot answers calls ``self.robot.health(Health(Level.OFFLINE, why))`` before it returns.
        """

    async def run(self) -> None:
        """Serve the robot until the connection ends. The default waits until a periodic call raises.

        Raises LinkLost, LinkRefused or Fault as ``connect`` does. After any end the host halts the robot
        while its link is still open, closes the contexts, waits with growing delays and creates a new
        adapter.
        """
        await asyncio.get_running_loop().create_future()

    def drive(self, velocity: Velocity) -> None:
        """Hold this body velocity until the next call or a stop; must not block.

        The host has clamped the velocity. It calls again with zero when the lease expires.
        """
        super().drive(velocity)

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return the joints that accept targets now, by name; targets of other joints are refused.

        Each joint must be in a ``JointReport`` of the robot: the host moves it from its measured position.
        """
        return {}

    def move_joints(self, targets: Mapping[str, float]) -> None:  # noqa: ARG002 - for overriders
        """Move these joints to their targets (rad or m) at once and hold them there; must not block.

        The host calls it many times per second, with steps limited by the range and speed of each joint.
        """
        raise Unsupported(f"{type(self).__name__} takes no joint targets")

    def hold_joints(self) -> None:
        """Hold the joints at their present positions after the last target; same rules as for ``halt``.

        ``halt`` and ``stop`` must do it as well.
        """
        self.halt()

    @abstractmethod
    async def stop(self, reason: str) -> None:
        """Bring the robot to a safe standstill and hold it; its return means that it was seen to stand.

        Raises a CommandError or LinkError with the reason if it was not. Without feedback the return means
        that the stop was written.

        For an aircraft: brake and hold position in the air, never cut the motors. The host limits its
        duration.
        """

    @abstractmethod
    def halt(self) -> None:
        """Write the safe-stop bytes at once; called from any thread, also while the event loop is blocked.

        Must not block, use the event loop or raise: a halt that raises ends this attempt as a failure.
        """

    def emergency_halt(self) -> None:
        """Write the bytes of an emergency stop at once, if the robot has special ones; rules as for ``halt``.

        ``stop("emergency_stop")`` follows as soon as the event loop runs.
        """
        self.halt()

    def halt_unheard(self, reason: str) -> bool:
        """Write a requested stop to a robot that does not answer but may receive; rules as for ``halt``.

        ``reason`` is the requested stop: ``stop``, ``emergency_stop`` and others. Returns True if the bytes
        were handed to an open link, False if the adapter does not know. Raises LinkError or a CommandError
        with the reason if nothing was written.
        """
        (self.emergency_halt if reason == EMERGENCY else self.halt)()
        return False

    def navigate(self, task: Task) -> AsyncIterator[Progress]:  # noqa: ARG002 - for overriders
        """Execute a task and yield its progress; return when it is done, raise when it fails.

        The host cancels the iteration for a stop, a newer goal or teleoperation, and then stops the robot.
        """
        raise Unsupported(f"{type(self).__name__} does not navigate")


class Send(msgspec.Struct, frozen=True):
    """A frame that a FrameAdapter sends in answer to a decoded frame."""

    frame: bytes


class Until(msgspec.Struct, frozen=True):
    """Pauses a command of a FrameAdapter until ``seen()`` returns True; checked after each decoded frame.

    The command then continues with its next frames. After the last one it is done.
    """

    seen: Callable[[], bool]


class FrameAdapter(AdapterBase[ConfigT]):
    """A robot that exchanges frames over a link: pure translation without I/O, clock or tasks.

    ``Config`` must have a ``link`` field. The host opens the link, splits the bytes into frames by
    ``framing``, calls the methods, writes the frames that they yield, repeats the last velocity every
    ``repeat`` seconds during its lease, and calls ``tick`` every ``tick_every`` seconds. A command is a
    method marked ``@command``; it yields frames, and ``Until`` to wait for a report of the robot.
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
        """Return the joints that accept targets, as in Adapter; override ``encode_joints`` as well."""
        return {}

    def encode_joints(self, targets: Mapping[str, float]) -> Iterable[bytes]:  # noqa: ARG002 - for overriders
        """Yield the frames that move these joints to their targets (rad or m) at once and hold them there.

        After the last target the host writes ``halt``, which must hold the joints at their present positions.
        """
        raise Unsupported(f"{type(self).__name__} takes no joint targets")

    @abstractmethod
    def decode(self, frame: bytes, stamp: float) -> Iterable[Report | Send | Health]:
        """Yield the contents of one frame, measured at ``stamp`` (Unix s); nothing for noise.

        A ``Health`` applies until the next one. A robot that never yields one is ok while its frames decode.
        """

    @abstractmethod
    def halt(self) -> Iterable[bytes]:
        """Yield the safe-stop frames; never empty, never raises."""

    def hello(self) -> Iterable[bytes]:
        """Yield the first frames to send on a new link."""
        return ()

    def tick(self) -> Iterable[bytes]:
        """Yield keep-alive and polling frames."""
        return ()


AnyAdapter = Adapter[Any] | FrameAdapter[Any]
