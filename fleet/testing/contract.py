r"""The contract of an adapter, as tests: subclass, name the adapter and an example of its config.

    class TestRover(FrameContract):
        adapter = Rover
        config = {"adapter": "rover", "link": "tcp:127.0.0.1:9000"}
        said = (b"B 24.1 87\n",)

No robot and no link is needed, and of pytest no plugin. Whoever passes can be run by the host; what its
robot does is for tests of its own.
"""

from __future__ import annotations

import asyncio
import math
import re
import typing
from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
import pytest
from pydantic import ValidationError

from fleet.adapter import Adapter, AdapterConfig, FrameAdapter
from fleet.commands import CommandSpec, arguments
from fleet.errors import CommandError, LinkError, Refused, Unsupported
from fleet.host.robot.adapter_factory import AdapterClass, capabilities, create_adapter, start_command
from fleet.host.robot.frame_adapter_runner import FrameAdapterRunner
from fleet.link.framing import DatagramFraming
from fleet.model.command import Command
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.testing.probes import SOON, containers_of, in_time, noise_like, numbers_in, unless_refused
from fleet.testing.wires import Datagrams, OneByteAtATime

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


class AdapterContract:
    """What the host relies on, whatever the robot. ``config`` needs no ``name`` and no ``twin``."""

    adapter: ClassVar[AdapterClass]
    config: ClassVar[Mapping[str, Any]]
    leaves_halt: ClassVar[bool] = False  # its ``run`` calls ``robot.leave_halt``

    def make_config(self, **changes: object) -> AdapterConfig:
        """Return the example config with changes."""
        basics = {"name": "robot", "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"}
        return self.adapter.Config.model_validate(basics | dict(self.config) | changes)

    def make(self) -> Adapter[Any]:
        """Return a new adapter as the host makes it, not yet run."""
        return create_adapter(self.adapter, self.make_config())

    def test_the_example_config_is_accepted(self) -> None:
        assert self.make_config().name == "robot"

    def test_the_config_names_its_adapter(self) -> None:
        names = typing.get_args(self.adapter.Config.model_fields["adapter"].annotation)
        assert names == (self.make_config().model_dump()["adapter"],)

    def test_an_unknown_config_field_is_refused(self) -> None:
        with pytest.raises(ValidationError, match="no_such_field"):
            self.make_config(no_such_field=1)

    def test_every_config_field_of_its_own_is_described(self) -> None:
        fields = self.adapter.Config.model_fields
        own = fields.keys() - AdapterConfig.model_fields.keys() - {"adapter"}
        assert [name for name in sorted(own) if not fields[name].description] == []

    def test_the_adapter_says_what_it_is_for(self) -> None:
        assert (self.adapter.__doc__ or "").strip()

    def test_every_command_has_a_plain_name_and_a_bounded_time(self) -> None:
        for name, spec in self._commands().items():
            assert re.fullmatch(r"[a-z][a-z0-9_]*", name), name
            assert 0 < spec.timeout < math.inf, name

    def test_every_command_method_says_what_it_does(self) -> None:
        methods = {name: spec for name, spec in self._commands().items() if spec.method != "encode"}
        assert [name for name, spec in methods.items() if not spec.summary] == []

    def test_every_number_of_a_command_has_a_range_and_a_unit(self) -> None:
        for name, spec in self._commands().items():
            fields = msgspec.structs.fields(spec.parameters)
            numbers = [field.name for field in fields if _is_number(field.type)]
            assert [each for each in numbers if each not in spec.ranges] == [], f"{name} needs a Range"
            assert all(bounds.unit and bounds.least < bounds.most for bounds in spec.ranges.values()), name

    def test_data_that_a_command_does_not_know_is_refused_before_anything_moves(self) -> None:
        for spec in self._commands().values():
            if spec.moves and not spec.safe:
                with pytest.raises(Refused, match="takes no 'no_such_field'"):
                    arguments(spec, {"no_such_field": 1})

    def test_something_stops_it_when_its_process_dies(self) -> None:
        adapter = self.make()
        assert adapter.failsafe or self.leaves_halt or isinstance(adapter, FrameAdapterRunner), (
            "declare failsafe, what of the robot's own stops it and when; or call robot.leave_halt in run "
            "and set leaves_halt here"
        )

    def test_a_robot_that_drives_says_how_fast(self) -> None:
        can = capabilities(self.adapter)
        assert can.limits.speed or not can.drives

    def test_stop_without_a_link_ends_and_does_not_fail(self) -> None:
        async def stopped() -> None:
            async with asyncio.timeout(SOON):
                await self.make().stop("a test")

        asyncio.run(stopped())

    def test_halt_works_on_another_thread_while_the_loop_is_stuck(self) -> None:
        async def halted() -> None:
            adapter = self.make()
            for halt in (adapter.halt, adapter.emergency_halt):
                in_time(halt)
                in_time(halt)

        asyncio.run(halted())

    def test_a_velocity_without_a_link_raises_nothing_but_a_refusal(self) -> None:
        async def driven() -> None:
            adapter = self.make()
            for velocity in EXTREMES:
                unless_refused(adapter.drive, velocity)

        asyncio.run(driven())

    def test_a_command_without_a_link_is_refused_in_time(self) -> None:
        async def asked(name: str, spec: CommandSpec) -> bool:
            async with asyncio.timeout(SOON):
                return await _refused(self.make(), spec, Command(name))

        for name, spec in self._commands().items():
            assert asyncio.run(asked(name, spec)), name

    def test_two_robots_share_no_state(self) -> None:
        mine, other = self.make(), self.make()
        assert containers_of(mine).isdisjoint(containers_of(other))

    def _commands(self) -> Mapping[str, CommandSpec]:
        """Return what the adapter declares."""
        return capabilities(self.adapter).commands


class FrameContract(AdapterContract):
    """What the host relies on from a FrameAdapter besides.

    ``said`` is what its robot says, frame by frame, as it comes from the link: line endings and all.
    """

    adapter: ClassVar[type[FrameAdapter[Any]]]
    said: ClassVar[tuple[bytes, ...]] = ()

    def inner(self) -> FrameAdapter[Any]:
        """Return a new FrameAdapter, without the host around it."""
        return self.adapter(self.make_config())

    def frames(self) -> list[bytes]:
        """Return what ``said`` holds, cut into frames."""
        cutter = self.adapter.framing.cutter()
        return [frame for piece in self.said for frame in cutter.feed(piece)]

    def test_its_config_has_a_link(self) -> None:
        assert "link" in self.adapter.Config.model_fields

    def test_each_example_of_what_the_robot_says_means_something(self) -> None:
        assert len(self.frames()) == len(self.said) > 0
        assert [frame for frame in self.frames() if not list(self.inner().decode(frame, STAMP))] == []

    def test_frames_are_the_same_however_the_line_cuts_them(self) -> None:
        cutter = self.adapter.framing.cutter()
        wire = Datagrams() if isinstance(self.adapter.framing, DatagramFraming) else OneByteAtATime()
        pieces = [piece for data in self.said for piece in wire.carry(data)]
        assert [frame for piece in pieces for frame in cutter.feed(piece)] == self.frames()

    def test_halt_is_never_empty_and_works_at_any_time(self) -> None:
        inner = self.inner()
        for _ in range(3):
            frames = in_time(lambda: list(inner.halt()))
            assert frames
            assert all(isinstance(frame, bytes) and frame for frame in frames)
            unless_refused(self._encoded, inner, Velocity(Vector3(1.0), 1.0))

    def test_every_velocity_becomes_frames_or_is_refused(self) -> None:
        inner = self.inner()
        for velocity in EXTREMES if self.adapter.drives else ():
            assert in_time(unless_refused, self._encoded, inner, velocity) != []

    def test_standing_still_is_never_refused(self) -> None:
        assert self._encoded(self.inner(), ZERO_VELOCITY) if self.adapter.drives else True

    def test_every_verb_becomes_frames_or_is_refused(self) -> None:
        for verb in self.adapter.verbs:
            assert in_time(unless_refused, self._encoded, self.inner(), Command(verb)) != [], verb

    def test_a_verb_that_is_not_declared_is_refused(self) -> None:
        with pytest.raises((Refused, Unsupported)):
            self._encoded(self.inner(), Command("no_such_verb"))

    def test_hello_and_tick_yield_frames(self) -> None:
        inner = self.inner()
        frames = in_time(lambda: [*inner.hello(), *inner.tick()])
        assert all(isinstance(frame, bytes) and frame for frame in frames)

    def test_decode_survives_whatever_arrives(self) -> None:
        inner = self.inner()
        noise = noise_like(self.frames())
        reports = in_time(lambda: [report for frame in noise for report in inner.decode(frame, STAMP)])
        assert [report for report in reports if not all(map(math.isfinite, numbers_in(report)))] == []

    def test_one_robots_frames_do_not_change_another(self) -> None:
        before = [*self.inner().hello(), *self.inner().halt()]
        heard = self.inner()
        for frame in self.frames():
            list(heard.decode(frame, STAMP))
        assert [*self.inner().hello(), *self.inner().halt()] == before

    @staticmethod
    def _encoded(inner: FrameAdapter[Any], ask: Command | Velocity) -> list[bytes]:
        """Return the frames that carry something out."""
        return list(inner.encode(ask))


def _is_number(form: object) -> bool:
    """Return True for a type whose values are numbers, or lists of them, or nothing."""
    return any(_is_number(inner) for inner in typing.get_args(form)) or form in (int, float)


async def _refused(adapter: Adapter[Any], spec: CommandSpec, command: Command) -> bool:
    """Return True when a command ends in one of the errors that the host understands."""
    try:
        doing = start_command(adapter, spec, command)
        if spec.streams:
            async for _ in doing:
                pass
        else:
            await doing
    except (CommandError, LinkError):
        return True
    return False
