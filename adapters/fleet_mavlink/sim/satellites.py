"""Simulated satellite receiver and estimator, also without satellites, as recorded with both autopilots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.uptime import Uptime


@dataclass(frozen=True, slots=True)
class Loss:
    """Loss of position of one autopilot. Times are seconds after the loss of satellites.

    ``shown``: when the receiver reports it; ``fix``, ``count``, ``error``: its values then (error in
    centimetres). ``flags``: times and flags of the estimator; ``drifts``: start of the drift, with ``pull``
    m/s2 up to ``most`` m/s.
    """

    shown: float
    fix: int
    count: int
    error: int
    flags: tuple[tuple[float, int], ...]
    drifts: float
    pull: float
    most: float


@dataclass(frozen=True, slots=True)
class GpsProfile:
    """The satellite receiver and the estimator of one autopilot. Times are seconds of the real one.

    ``found_after``: from boot to the first satellites; ``usable_after``: from boot to a usable position;
    ``grace``: without satellites until the position is no longer usable. ``switch``: the parameter that
    switches the receiver off, and its value then. ``fix_type``: GPS_FIX_TYPE with satellites.
    """

    found_after: float
    usable_after: float
    grace: float
    switch: tuple[str, float]
    fix_type: int
    loss: Loss


ARDUPILOT_GPS = GpsProfile(
    found_after=10.0,
    usable_after=42.6,
    grace=8.1,
    switch=("SIM_GPS_DISABLE", 1.0),
    fix_type=6,
    loss=Loss(0.9, 1, 3, 121, ((7.9, 0x0025), (15.2, 0x00A7)), 15.2, 0.5, 0.8),
)
PX4_GPS = GpsProfile(
    found_after=0.0,
    usable_after=4.6,
    grace=5.1,
    switch=("SIM_GPS_USED", 0.0),
    fix_type=3,
    loss=Loss(0.4, 0, 0, 10000, ((5.5, 0x0365), (7.5, 0x0065)), 5.5, 0.6, 14.7),
)
GOOD, STARTING = 0x033F, 0x00A7


class Drift:
    """Error of the estimated position to the east, m, and its speed."""

    def __init__(self, loss: Loss) -> None:
        self.loss = loss
        self.east = 0.0
        self.speed = 0.0

    def tick(self, lost_for: float | None, dt: float) -> None:
        """Advance; with satellites the error is gone at once."""
        if lost_for is None:
            self.east = self.speed = 0.0
        elif lost_for > self.loss.drifts:
            self.speed = min(self.loss.most, self.speed + self.loss.pull * dt)
            self.east += self.speed * dt

    def flags(self, lost_for: float | None, *, usable: bool) -> int:
        """Return the estimator's flags."""
        if lost_for is not None:
            passed = [flags for after, flags in self.loss.flags if lost_for >= after]
            if passed:
                return passed[-1]
        return GOOD if usable else STARTING


class GpsReceiver:
    """The satellite receiver of one vehicle, and the drift of the estimated position without satellites.

    A fault or a parameter switches it off. ``now`` returns the simulation's time, s.
    """

    def __init__(
        self,
        profile: GpsProfile,
        params: Params,
        faults: Mapping[str, float],
        uptime: Uptime,
        now: Callable[[], float],
    ) -> None:
        self.profile = profile
        self.drift = Drift(profile.loss)
        self._params = params
        self._faults = faults
        self._uptime = uptime
        self._now = now
        self._lost_at: float | None = None

    def _is_off(self) -> bool:
        """Return True while the receiver is switched off."""
        parameter, off = self.profile.switch
        return "gps_loss" in self._faults or self._params[parameter] == off

    @property
    def fix(self) -> bool:
        """True while the receiver has a position."""
        return self._uptime.reached(self.profile.found_after) and not self._is_off()

    @property
    def lost_for(self) -> float | None:
        """Seconds since the satellites were lost, None while there are some."""
        return None if self._lost_at is None else self._now() - self._lost_at

    @property
    def usable(self) -> bool:
        """True once the estimator uses the receiver, and until it has been without for its grace."""
        lost_for = self.lost_for
        started = self._uptime.reached(self.profile.usable_after)
        return started and (lost_for is None or lost_for <= self.profile.grace)

    def tick(self, dt: float) -> None:
        """Note the loss of satellites, and let the estimate drift for ``dt`` seconds."""
        if not self._is_off():
            self._lost_at = None
        elif self._lost_at is None:
            self._lost_at = self._now()
        self.drift.tick(self.lost_for, dt)
