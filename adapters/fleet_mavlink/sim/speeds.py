"""Speeds of each autopilot, by its parameters; m/s, read at every use."""

from __future__ import annotations

from abc import ABC, abstractmethod

from fleet_mavlink.sim.params import Params


class FlightSpeeds(ABC):
    """Speeds of one autopilot; ``requested``: speed of the last DO_CHANGE_SPEED."""

    def __init__(self, params: Params) -> None:
        self.requested: float | None = None
        self._params = params

    @property
    @abstractmethod
    def cruise(self) -> float:
        """Speed towards a position."""

    @property
    @abstractmethod
    def top(self) -> float:
        """Limit of a velocity setpoint."""

    @property
    @abstractmethod
    def climb(self) -> float:
        """Maximum climb rate."""

    @property
    @abstractmethod
    def sink(self) -> float:
        """Maximum descent rate."""

    @property
    @abstractmethod
    def takeoff(self) -> float:
        """Climb rate during a take-off."""

    @property
    @abstractmethod
    def landing(self) -> tuple[float, float, float]:
        """Descent rate of a landing high up, near the ground, and the height (m) between the two."""

    @property
    @abstractmethod
    def yaw_follows_course(self) -> bool:
        """True if the nose turns into the direction of travel."""


class ArduPilotSpeeds(FlightSpeeds):
    """Speeds by WPNAV_* and LAND_SPEED, cm/s; a requested speed stays in force."""

    @property
    def cruise(self) -> float:
        """WPNAV_SPEED."""
        return self.requested or self._params["WPNAV_SPEED"] / 100

    @property
    def top(self) -> float:
        """The same limit as towards a position."""
        return self.cruise

    @property
    def climb(self) -> float:
        """WPNAV_SPEED_UP."""
        return self._params["WPNAV_SPEED_UP"] / 100

    @property
    def sink(self) -> float:
        """WPNAV_SPEED_DN."""
        return self._params["WPNAV_SPEED_DN"] / 100

    @property
    def takeoff(self) -> float:
        """The usual climb rate."""
        return self.climb

    @property
    def landing(self) -> tuple[float, float, float]:
        """WPNAV_SPEED_DN above 10 m, LAND_SPEED below."""
        return self.sink, self._params["LAND_SPEED"] / 100, 10.0

    @property
    def yaw_follows_course(self) -> bool:
        """True for a WP_YAW_BEHAVIOR other than 0."""
        return self._params["WP_YAW_BEHAVIOR"] != 0


class Px4Speeds(FlightSpeeds):
    """Speeds by MPC_*."""

    @property
    def cruise(self) -> float:
        """MPC_XY_CRUISE."""
        return self.requested or self._params["MPC_XY_CRUISE"]

    @property
    def top(self) -> float:
        """MPC_XY_VEL_MAX."""
        return self._params["MPC_XY_VEL_MAX"]

    @property
    def climb(self) -> float:
        """MPC_Z_VEL_MAX_UP."""
        return self._params["MPC_Z_VEL_MAX_UP"]

    @property
    def sink(self) -> float:
        """MPC_Z_VEL_MAX_DN."""
        return self._params["MPC_Z_VEL_MAX_DN"]

    @property
    def takeoff(self) -> float:
        """MPC_TKO_SPEED."""
        return self._params["MPC_TKO_SPEED"]

    @property
    def landing(self) -> tuple[float, float, float]:
        """MPC_Z_VEL_MAX_DN above MPC_LAND_ALT1, MPC_LAND_SPEED below."""
        return self.sink, self._params["MPC_LAND_SPEED"], self._params["MPC_LAND_ALT1"]

    @property
    def yaw_follows_course(self) -> bool:
        """True for an MPC_YAW_MODE along the way: 0, 4 (nose first) and 3."""
        return int(self._params["MPC_YAW_MODE"]) in {0, 3, 4}
