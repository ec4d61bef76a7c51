"""Simulated robots for rehearsals: in simulated time, with bytes in and out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Pose
from fleet.robot_config import AdapterConfig


class SimulationStart(msgspec.Struct, frozen=True):
    """The state of a robot at the start of a rehearsal.

    - ``pose`` is in the robot's own world frame.
    - ``point`` is its place on Earth (altitude: m above mean sea level), None if unknown.
    - ``heading`` is in radians counter-clockwise from east, None if unknown.
    - ``battery`` is in percent.
    - ``mode`` is the robot's name of its mode; ``armed``: its motors run.
    - ``seed`` and ``epoch`` (Unix s at time 0) are those of the rehearsal.
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
    """A simulated robot without a clock: ``now`` is seconds since its start and never decreases.

    - ``what`` names the simulator for users.
    - ``config`` connects the adapter to it by the link ``memory:<name of the robot>``.
    - ``receive(data, now)`` passes bytes of the adapter, ``step(now)`` advances the time; both return the
      bytes that the robot sends.
    - ``state`` is the initial ``robot.state`` of its adapter.
    """

    what: str
    config: AdapterConfig
    receive: Callable[[bytes, float], bytes]
    step: Callable[[float], bytes]
    state: Mapping[str, Any] = {}
