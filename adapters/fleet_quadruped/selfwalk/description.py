"""Description of a self-walking machine, validated when it is read."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from fleet import STANDARD_ID
from fleet_quadruped.frames import FrameMap
from fleet_quadruped.robot.busload import HIGHEST, frame_bits
from fleet_quadruped.robot.parts import (
    CanBusConfig,
    Machine,
    Pace,
    PositiveNumber,
    Section,
    Sensor,
    Switch,
    WatchLimits,
)
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk import by_frames, by_objects
from fleet_quadruped.selfwalk.by_frames import WalkerFrames
from fleet_quadruped.selfwalk.by_objects import Objects
from fleet_quadruped.selfwalk.wire import AXES, WalkerWire

_LEAVE = 6.0  # s to sit down
_MUST_TELL = ("mode", *AXES)
_MUST_BE = (BodyMode.OFF, BodyMode.STANDING)


def _word(mode: object) -> object:
    """Return a mode from YAML, where a bare ``off`` is read as false."""
    return "off" if mode is False else mode


class SelfWalker(Section):
    """Complete description of a self-walking machine."""

    robot: Machine
    buses: dict[str, CanBusConfig] = Field(min_length=1, max_length=1)
    cycle_hz: int = Field(50, ge=10, le=200, description="Velocities sent per second.")
    silence: float = Field(
        ge=0.05,
        le=1.0,
        description="Seconds without a velocity after which the machine itself stands still; one that "
        "never does must not be driven over CAN.",
    )
    timeout: float = Field(0.2, gt=0, le=2, description="Silence after which its state is stale, s.")
    slow_timeout: PositiveNumber = Field(5.0, description="Silence after which its slow values are stale, s.")
    pace: Pace = Pace()
    height: PositiveNumber = Field(0.27, description="Standing height after standing up, m.")
    lowest: PositiveNumber = Field(0.15, description="Lowest standing height, m.")
    highest: PositiveNumber = Field(0.32, description="Highest standing height, m.")
    modes: dict[int, Annotated[BodyMode, BeforeValidator(_word)]] = Field(
        description="Meaning of its mode numbers."
    )
    errors: dict[int, str] = Field({}, description="Meaning of its error numbers; 0 is no error.")
    frames: WalkerFrames | None = Field(None, description="Messages of a machine with proprietary frames.")
    objects: Objects | None = Field(
        None, description="Messages of a machine with a CANopen object dictionary."
    )
    warn: float = Field(25, ge=0, le=100, description="Battery percentage at which health becomes degraded.")
    sit_at: float = Field(10, ge=0, le=100, description="Battery percentage at which it sits down.")
    led: Switch | None = None
    safety: WatchLimits = WatchLimits()

    @model_validator(mode="after")
    def _whole(self) -> SelfWalker:
        """Refuse a description that the machine cannot walk with; the error has all problems."""
        if (self.frames is None) == (self.objects is None):
            raise ValueError("give either frames or objects")
        reported = names_of(self.wire.state)
        problems = [f"state: it must report {name}" for name in _MUST_TELL if name not in reported]
        problems += [
            f"modes: no number means {mode.value}" for mode in _MUST_BE if mode not in self.modes.values()
        ]
        if not self.lowest <= self.height <= self.highest:
            problems.append(f"height {self.height:g} is not between lowest and highest")
        if self.led is not None and self.led.bus not in self.buses:
            problems.append(f"led: there is no bus {self.led.bus!r}")
        if self.silence < 3 * self.dt:
            problems.append(f"silence: {self.silence:g} s is less than three cycles of {self.dt:g} s")
        if (load := self.loads[self.bus]) > HIGHEST:
            problems.append(f"buses: {self.bus} would be {load:.0%} full, more than {HIGHEST:.0%}")
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def bus(self) -> str:
        """Name of its bus."""
        return next(iter(self.buses))

    @property
    def dt(self) -> float:
        """Control cycle in s."""
        return 1.0 / self.cycle_hz

    @property
    def battery_timeout(self) -> float | None:
        """Age (s) at which a battery measurement is stale; None without a battery."""
        return self.slow_timeout if "percent" in names_of(self.wire.slow) else None

    @property
    def leave_time(self) -> float:
        """Time (s) for sitting down."""
        return _LEAVE

    @cached_property
    def wire(self) -> WalkerWire:
        """Frames to and from the machine."""
        if self.objects is not None:
            return by_objects.wire_of(self.objects, self.silence)
        assert self.frames is not None
        return by_frames.wire_of(self.frames)

    @property
    def loads(self) -> dict[str, float]:
        """Load of its bus, as a share."""
        wire = self.wire
        bits = sum(
            frame_bits(frame.length, extended=frame.id > STANDARD_ID)
            for frame in (*wire.velocity, *wire.state)
        )
        bits += sum(frame_bits(len(frame.data)) for frame in wire.alive)
        return {self.bus: bits * self.cycle_hz / self.buses[self.bus].bitrate}

    def sensors(self) -> tuple[Sensor, Sensor | None]:
        """Return the fast values (each cycle) and the slow ones, if any."""
        state = Sensor(bus=self.bus, frames=self.wire.state, timeout=self.timeout)
        if not self.wire.slow:
            return state, None
        return state, Sensor(bus=self.bus, frames=self.wire.slow, timeout=self.slow_timeout)


def names_of(frames: tuple[FrameMap, ...]) -> frozenset[str]:
    """Return the names of the values in these frames."""
    return frozenset(name for frame in frames for name in frame.fields)
