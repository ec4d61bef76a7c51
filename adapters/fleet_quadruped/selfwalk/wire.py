"""What goes over the wire to a machine that walks by itself, however it was described."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet import CanFrame
from fleet_quadruped.drives.cia402.setup import Object
from fleet_quadruped.frame_integrity import Sealed
from fleet_quadruped.frames import FrameMap

AXES = ("x", "y", "turn")
"""A velocity: m/s forward, m/s left, rad/s counter-clockwise."""

COMMANDS = ("stand_up", "sit_down", "emergency_stop", "recovery_stand", "reset_faults")
"""What a machine is told with a frame that is always the same; the last two may be missing."""


class Wire(NamedTuple):
    """Frames out and in. ``alive`` goes before each velocity; ``node`` is a CANopen machine's id.

    ``seals``: by the identifiers of frames that go out, the counters and checksums that they need.
    """

    velocity: tuple[FrameMap, ...]
    commands: Mapping[str, CanFrame]
    height: Callable[[float], CanFrame] | None
    state: tuple[FrameMap, ...]
    slow: tuple[FrameMap, ...]
    start: tuple[CanFrame, ...] = ()
    alive: tuple[CanFrame, ...] = ()
    node: int | None = None
    setup: tuple[Object, ...] = ()
    seals: Mapping[int, Sealed] = MappingProxyType({})
