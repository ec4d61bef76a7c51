"""What a kind of robot has for rehearsals: a simulated robot in simulated time, bytes in and bytes out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Pose
from fleet.robot_config import AdapterConfig


class SimulationStart(msgspec.Struct, frozen=True):
    """How a robot stands when a rehearsal begins.

    ``pose`` is in the robot's own world. ``point`` is where that is on Earth (altitude: m above mean sea
    level), ``heading`` radians counter-clockwise from east; None while unknown. ``battery`` is percent,
    ``mode`` what the robot calls its mode, ``armed`` whether its motors run. ``seed`` and ``epoch`` (Unix s
    at time 0) are the rehearsal's.
    """

    pose: Pose = Pose()
    point: GeoPoint | None = None
    heading: float | None = None
    battery: float | None = None
    mode: str = ""
    armed: bool = False
    seed: int = 1
    epoch: float = 0.0


class Simulation(msgspec.Struct, frozen=True):
    """A simulated robot. It has no clock: ``now`` is seconds since its start and only grows.

    ``what`` names the simulator for people. ``config`` leads the adapter to it: its link is
    ``memory:<name of the robot>``. ``receive(data, now)`` takes what the adapter sends, ``step(now)`` lets
    time pass; both return the bytes that the robot sends. ``state`` is what its adapter finds in
    ``robot.state``.
    """

    what: str
    config: AdapterConfig
    receive: Callable[[bytes, float], bytes]
    step: Callable[[float], bytes]
    state: Mapping[str, Any] = {}
