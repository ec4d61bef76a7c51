"""Messages to and from a self-walking machine, for either kind of description."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet import CanFrame
from fleet_quadruped.drives.cia402.setup import Object
from fleet_quadruped.frame_integrity import ProtectedFrame
from fleet_quadruped.frames import FrameMap

AXES = ("x", "y", "turn")
"""A velocity: m/s forward, m/s left, rad/s counter-clockwise."""

COMMANDS = ("stand_up", "sit_down", "emergency_stop", "recovery_stand", "reset_faults")
"""Commands with a constant frame; the last two are optional."""


class WalkerWire(NamedTuple):
    """Frames out and in. ``alive`` is sent before each velocity; ``node``: node id of a CANopen machine.

    ``protected``: counters and checksums of outgoing frames, by identifier.
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
    protected: Mapping[int, ProtectedFrame] = MappingProxyType({})
