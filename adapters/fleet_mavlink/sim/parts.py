"""The parts of a simulated autopilot that differ from vehicle to vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fleet_mavlink.sim.arming_checks import ArmingChecks
from fleet_mavlink.sim.fence import FenceBounds
from fleet_mavlink.sim.home import SimHome
from fleet_mavlink.sim.land_detector import LandDetector
from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.setpoints import SetpointControl
from fleet_mavlink.sim.speeds import FlightSpeeds
from fleet_mavlink.sim.system_status import SystemStatus


class SimFailsafes(Protocol):
    """Fail-safes of one simulated autopilot."""

    def watch(self) -> None:
        """Check all of them; called once per step."""


@dataclass(frozen=True, slots=True)
class Parts:
    """How the parts of one kind of vehicle are made.

    ``speeds`` is made from the parameters, which also give the ``fence`` that is switched on, None without
    one. The others are made with their autopilot, once per boot.
    """

    speeds: Callable[[Params], FlightSpeeds]
    fence: Callable[[Params], FenceBounds | None]
    arming: Callable[..., ArmingChecks]
    status: Callable[..., SystemStatus]
    setpoints: Callable[..., SetpointControl]
    failsafes: Callable[..., SimFailsafes]
    land_detector: Callable[..., LandDetector] = LandDetector
    home: Callable[..., SimHome] = SimHome
