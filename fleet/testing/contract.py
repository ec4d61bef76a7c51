r"""The contract of an adapter as tests: subclass, name the adapter and an example of its config.

    class TestRover(FrameContract):
        adapter = Rover
        config = {"adapter": "rover", "link": "tcp:127.0.0.1:9000"}
        said = (b"B 24.1 87\n",)

It needs no robot, no link and no pytest plugin. An adapter that passes can be run by the host: it comes
online, moves as commanded and not otherwise, stands still after a stop, and leaves nothing behind.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import math
import re
import struct
import typing
from collections.abc import AsyncIterator, Mapping
from typing import Any, ClassVar

import msgspec
import pytest
from pydantic import ValidationError

from fleet.adapter import Adapter, AdapterConfig, FrameAdapter
from fleet.commands import CommandSpec, arguments
from fleet.errors import CommandError, LinkError, Refused
from fleet.host.robot.adapter_factory import AdapterClass, capabilities, create_adapter
from fleet.link.framing import DatagramFraming
from fleet.link.memory import MemoryRobot
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.testing.bench import ONLINE_WITHIN, STEP, Bench, connected
from fleet.testing.motion import MotionTrial, trial_velocities
from fleet.testing.probes import (
    containers_of,
    corrupted_frames,
    implausible,
    in_time,
    least_data,
    near,
    unless_refused,
)
from fleet.testing.robot import LoopRobot, RecordingRobot
from fleet.testing.wires import Datagrams, OneByteAtATime

TALKS = 0.2  # s between two frames of a robot in memory
STAMP = 1_800_000_000.0  # Unix s
EXTREMES = tuple(
    Velocity(Vector3(*linear), yaw_rate)
    for linear, yaw_rate in (
        ((0.0, 0.0, 0.0), 0.0),
        ((-0.0, 0.0, -0.0), -0.0),
        ((1e-9, -1e-9, 1e-9), 1e-9),
        ((1e9, -1e9, 1e9), -1e9),
        ((-1e300, 1e300, -1e300), 1e300),
    )
)

_names = itertools.count()


class AdapterContract:
    """Tests of the properties on which the host relies. ``config`` needs no ``name`` and no ``twin``."""

    adapter: ClassVar[AdapterClass]
    config: ClassVar[Mapping[str, Any]]
    settles: ClassVar[float] = 5.0  # s until the robot follows a command

    def make_config(self, **changes: object) -> AdapterConfig:
        """Return the example config with changes."""
        basics = {"name": "robot", "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"}
        return self.adapter.Config.model_validate(basics | dict(self.config) | changes)

    @contextlib.asynccontextmanager
    async def robot_side(self) -> AsyncIterator[Mapping[str, Any]]:
        """Yield the config fields that lead to a robot; override it to start one first.

        By default ``config`` must lead to a robot by itself (``link: sim:...``).
        """
        yield {}

    async def prepare(self, bench: Bench) -> None:
        """Make a connected robot ready to drive; override it (``await bench.do("stand_up")``)."""

    def velocity(self, bench: Bench) -> Velocity | None:
        """Return the robot's present velocity in m/s and rad/s; None while it is unknown.

        By default it is computed from the reported poses. Override it if the robot reports none.
        """
        return bench.velocity_by_poses()

    @contextlib.asynccontextmanager
    async def bench(self) -> AsyncIterator[Bench]:
        """Connect an adapter to its robot and wait until it is online."""
        async with self.robot_side() as changes:
            config = self.make_config(**changes)
            robot = LoopRobot(limits=config.limits.over(self.adapter.limits))
            async with connected(create_adapter(self.adapter, config, robot), robot) as bench:
                assert await bench.until(lambda: bench.is_online, ONLINE_WITHIN), (
                    f"it never comes online: {robot.healths[-1:] or 'no report, no connect, no health'}"
                )
                yield bench

    def make(self) -> Adapter[Any]:
        """Return a new adapter as the host creates it, not connected yet."""
        return create_adapter(self.adapter, self.make_config(), RecordingRobot())

    def test_the_example_config_is_accepted(self) -> None:
        assert self.make_config().name == "robot"

    def test_the_config_names_its_adapter(self) -> None:
        names = typing.get_args(self.adapter.Config.model_fields["adapter"].annotation)
        said = self.make_config().model_dump()["adapter"]
        assert names == (said,), f"Config declares adapter: {names}, the example config says {said!r}"

    def test_an_unknown_config_field_is_refused(self) -> None:
        with pytest.raises(ValidationError, match="no_such_field"):
            self.make_config(no_such_field=1)

    def test_every_config_field_of_its_own_is_described(self) -> None:
        fields = self.adapter.Config.model_fields
        own = fields.keys() - AdapterConfig.model_fields.keys() - {"adapter"}
        bare = [name for name in sorted(own) if not fields[name].description]
        assert not bare, f"Config needs Field(description=...) for {', '.join(bare)}"

    def test_the_adapter_says_what_it_is_for(self) -> None:
        assert (self.adapter.__doc__ or "").strip(), f"{self.adapter.__name__} needs a docstring"

    def test_every_command_has_a_plain_name_and_a_bounded_time(self) -> None:
        for name, spec in capabilities(self.adapter).commands.items():
            assert re.fullmatch(r"[a-z][a-z0-9_]*", name), f"{name!r}: small letters, digits and _ only"
            assert 0 < spec.timeout < math.inf, f"{name} needs a timeout in seconds, not {spec.timeout}"

    def test_every_command_method_says_what_it_does(self) -> None:
        bare = [name for name, spec in capabilities(self.adapter).commands.items() if not spec.summary]
        assert not bare, f"these commands need a docstring, which is their help: {', '.join(bare)}"

    def test_every_number_of_a_command_has_a_range_and_a_unit(self) -> None:
        for name, spec in capabilities(self.adapter).commands.items():
            fields = msgspec.structs.fields(spec.parameters)
            numbers = [field.name for field in fields if _is_number(field.type)]
            bare = [each for each in numbers if each not in spec.ranges]
            assert not bare, f"{name}: {', '.join(bare)} needs a Range"
            for each, bounds in spec.ranges.items():
                assert bounds.unit, f"{name}: the Range of {each} needs a unit"
                assert bounds.least < bounds.most, f"{name}: the Range of {each} is empty: {bounds}"

    def test_data_that_a_command_does_not_know_is_refused_before_anything_moves(self) -> None:
        for spec in capabilities(self.adapter).commands.values():
            if spec.moves and not spec.safe:
                with pytest.raises(Refused, match="takes no 'no_such_field'"):
                    arguments(spec, {"no_such_field": 1})

    def test_it_comes_online_is_stopped_and_leaves_nothing_behind(self) -> None:
        async def live() -> None:
            async with self.bench() as bench:
                moves = capabilities(self.adapter).moves
                assert bench.adapter.failsafe or bench.robot.left_halts or not moves, (
                    "nothing stops the robot when this process dies: declare failsafe, what of its own does "
                    "and when, or call robot.leave_halt"
                )
                await bench.pass_time(STEP)
                for velocity in EXTREMES:
                    unless_refused(bench.adapter.drive, velocity)
                    in_time(bench.adapter.halt)
                in_time(bench.adapter.emergency_halt)
                with contextlib.suppress(CommandError, LinkError):  # it may say that nothing was written
                    in_time(bench.adapter.halt_unheard, "stop")
                await self.motion(bench).stop()

        asyncio.run(live())

    def test_it_moves_as_it_is_asked_and_stands_after_a_stop_and_a_halt(self) -> None:
        async def live() -> None:
            async with self.bench() as bench:
                await self.prepare(bench)
                motion = self.motion(bench)
                await motion.expect_still("though nothing has requested motion")
                for name, stop in (("stop", motion.stop), ("halt from another thread", motion.halt)):
                    for wanted in trial_velocities(self.make_config(), self.adapter):
                        await motion.drive(wanted)
                        await stop()
                        await motion.expect_still(f"after a {name}")

        if capabilities(self.adapter).drives:
            asyncio.run(live())

    def motion(self, bench: Bench) -> MotionTrial:
        """Return the trial that moves and stops the robot of a test."""
        return MotionTrial(bench, lambda: self.velocity(bench), self.settles)

    def test_a_robot_that_drives_says_how_fast(self) -> None:
        can = capabilities(self.adapter)
        assert can.limits.speed or not can.drives, "declare limits = Limits(speed=...) in m/s: it has drive"

    def test_two_robots_share_no_state(self) -> None:
        mine, other = self.make(), self.make()
        shared = containers_of(mine) & containers_of(other)
        assert not shared, "robots share a list, a set or another object of the class: make it in __init__"


class FrameContract(AdapterContract):
    """Additional tests of the properties on which the host relies in a FrameAdapter.

    ``said`` has examples of the robot's frames as they come from the link, with line endings.
    """

    adapter: ClassVar[type[FrameAdapter[Any]]]
    said: ClassVar[tuple[bytes, ...]] = ()
    settles: ClassVar[float] = 0.5

    def velocity_of(self, frame: bytes) -> Velocity | None:
        """Return the velocity that a frame sets; None if the frame does not affect motion.

        Write it from the robot's manual, not from the adapter: it detects a wrong unit or sign.
        """
        raise AssertionError(f"{type(self).__name__} needs velocity_of(frame): what does {frame!r} do?")

    def velocity(self, bench: Bench) -> Velocity | None:  # noqa: ARG002 - the frames in the machine decide
        """Return the velocity set by the newest motion frame that was written."""
        velocities = (self.velocity_of(frame) for frame in reversed(self.machine.heard))
        return next((velocity for velocity in velocities if velocity is not None), None)

    @contextlib.asynccontextmanager
    async def bench(self) -> AsyncIterator[Bench]:
        """Connect the adapter to a robot in memory that sends ``said``; the test advances the time."""
        with MemoryRobot(f"contract-{next(_names)}") as self.machine:
            config = self.make_config(link=f"memory:{self.machine.name}")
            robot = RecordingRobot(limits=config.limits.over(self.adapter.limits))
            async with connected(create_adapter(self.adapter, config, robot), robot) as bench:
                assert await bench.until(lambda: robot.is_connected, ONLINE_WITHIN), "connect does not return"
                talking = _ExampleSender(self.machine, self.said)
                robot.every(TALKS, talking.say)
                assert await bench.until(lambda: bench.is_online, ONLINE_WITHIN), (
                    f"it never comes online: {robot.healths[-1:]}"
                )
                yield bench

    def test_noise_on_its_link_ends_nothing_and_starts_nothing(self) -> None:
        async def live() -> None:
            async with self.bench() as bench:
                for noise in corrupted_frames(list(self.said)):
                    self.machine.say(noise)
                await bench.pass_time(STEP)
                if self.adapter.drives():
                    await self.motion(bench).expect_still("because of noise")

        asyncio.run(live())

    def test_a_command_that_is_declared_not_to_move_it_does_not_move_it(self) -> None:
        still = [spec for spec in capabilities(self.adapter).commands.values() if not spec.moves]
        for spec in still if self.adapter.drives() else ():
            frames = unless_refused(self._performed, self.inner(), spec) or []
            moving = [frame for frame in frames if isinstance(frame, bytes) and self._moves(frame)]
            assert not moving, f"{spec.name} says moves=False, but yields {moving}, which moves it"

    def _moves(self, frame: bytes) -> bool:
        """Return True for a frame that sets a velocity other than zero."""
        velocity = self.velocity_of(frame)
        return velocity is not None and not near(velocity, ZERO_VELOCITY)

    @staticmethod
    def _performed(inner: FrameAdapter[Any], spec: CommandSpec) -> list[Any]:
        """Return the frames that a command yields for its minimal data."""
        return list(getattr(inner, spec.method)(**least_data(spec)))

    def inner(self) -> FrameAdapter[Any]:
        """Return a new FrameAdapter without its runner."""
        return self.adapter(self.make_config())

    def frames(self) -> list[bytes]:
        """Return ``said``, split into frames."""
        framer = self.adapter.framing.framer()
        return [frame for piece in self.said for frame in framer.feed(piece)]

    def test_its_config_has_a_link(self) -> None:
        assert "link" in self.adapter.Config.model_fields, "Config needs a field link: LinkText"

    def test_each_example_of_what_the_robot_says_means_something(self) -> None:
        assert len(self.frames()) == len(self.said) > 0, "each item of said must be one whole frame"
        silent = [frame for frame in self.frames() if not list(self.inner().decode(frame, STAMP))]
        assert not silent, f"decode yields nothing for {silent}: leave frames without a report out of said"

    def test_frames_are_the_same_however_the_line_cuts_them(self) -> None:
        framer = self.adapter.framing.framer()
        wire = Datagrams() if isinstance(self.adapter.framing, DatagramFraming) else OneByteAtATime()
        pieces = [piece for data in self.said for piece in wire.carry(data)]
        found = [frame for piece in pieces for frame in framer.feed(piece)]
        assert found == self.frames(), f"in pieces the framing cuts {found}, at once {self.frames()}"

    def test_halt_is_never_empty_and_works_at_any_time(self) -> None:
        inner = self.inner()
        for _ in range(3):
            frames = in_time(lambda: list(inner.halt()))
            assert frames, "halt yields no frame: nothing stops the robot"
            self._expect_frames("halt", frames)
            unless_refused(self._encoded, inner, Velocity(Vector3(1.0), 1.0))

    def test_every_velocity_becomes_frames_or_is_refused(self) -> None:
        inner = self.inner()
        for velocity in EXTREMES if self.adapter.drives() else ():
            try:
                frames = in_time(unless_refused, self._encoded, inner, velocity)
            except (ValueError, ArithmeticError, struct.error) as error:
                raise AssertionError(f"drive({velocity}): {error}; clamp it, or raise Refused") from error
            assert frames != [], f"drive({velocity}) yields no frame"

    def test_standing_still_is_never_refused(self) -> None:
        if self.adapter.drives():
            assert self._encoded(self.inner(), ZERO_VELOCITY), "drive yields no frame for a velocity of zero"

    def test_hello_and_tick_yield_frames(self) -> None:
        inner = self.inner()
        self._expect_frames("hello and tick", in_time(lambda: [*inner.hello(), *inner.tick()]))

    def test_decode_survives_whatever_arrives(self) -> None:
        inner = self.inner()
        noise = corrupted_frames(self.frames())
        reports = in_time(lambda: [report for frame in noise for report in inner.decode(frame, STAMP)])
        flaws = [flaw for report in reports if (flaw := implausible(report, STAMP))]
        assert not flaws, f"decode must yield nothing for a damaged frame, but: {'; '.join(flaws[:3])}"

    def test_one_robots_frames_do_not_change_another(self) -> None:
        def frames_written() -> list[bytes]:
            fresh = self.inner()
            frames = [*fresh.hello(), *fresh.tick(), *fresh.halt()]
            # last: it would overwrite a shared velocity, also one that an earlier test has left
            return [*frames, *(self._encoded(fresh, ZERO_VELOCITY) if self.adapter.drives() else ())]

        frames_written()
        before, used = frames_written(), self.inner()
        for frame in self.frames():
            list(used.decode(frame, STAMP))
        for velocity in trial_velocities(self.make_config(), self.adapter) if self.adapter.drives() else ():
            self._encoded(used, velocity)
        now = frames_written()
        assert now == before, f"another robot changed what a new one writes from {before} to {now}"

    @staticmethod
    def _expect_frames(method: str, frames: list[bytes]) -> None:
        """Check that a method yielded bytes only, none of them empty."""
        wrong = [frame for frame in frames if not (isinstance(frame, bytes) and frame)]
        assert not wrong, f"{method} must yield bytes that are not empty, not {wrong}"

    @staticmethod
    def _encoded(inner: FrameAdapter[Any], velocity: Velocity) -> list[bytes]:
        """Return the frames that hold a velocity."""
        return list(inner.drive(velocity))


class _ExampleSender:
    """Sends the example frames in turn."""

    def __init__(self, machine: MemoryRobot, said: tuple[bytes, ...]) -> None:
        self._machine = machine
        self._said = itertools.cycle(said)

    def say(self) -> None:
        """Send the next frame."""
        for frame in itertools.islice(self._said, 1):
            self._machine.say(frame)


def _is_number(form: object) -> bool:
    """Return True for a type whose values are numbers, lists of numbers, or None."""
    return any(_is_number(inner) for inner in typing.get_args(form)) or form in (int, float)
