"""Summary of a robot for people, collected from its reports."""

from __future__ import annotations

import math

import msgspec

from fleet.model.geometry import Vector3
from fleet.model.report import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    MetricsReport,
    NavigationReport,
    PoseReport,
    Report,
)

MEASURED = 0.5  # s of poses over which the speed is measured
GAP = 2.0  # s without a pose after which the speed measurement restarts
STALE = 2.0  # s after which a measured speed is stale

READ = frozenset({PoseReport, BatteryReport, FlightStateReport, FlightControllerReport})
"""Reports that the host itself uses to show, guide and guard a robot; others are only passed on."""


class Snapshot:
    """Last mode, autopilot, vehicle, arming, battery, position, speed and home (m AMSL) of one robot.

    ``heard`` is the time of its last report (monotonic s); None before the first.
    """

    def __init__(self) -> None:
        self.mode = self.autopilot = self.vehicle = ""
        self.armed: bool | None = None
        self.battery: float | None = None
        self.position: Vector3 | None = None
        self.heading: float | None = None  # radians counter-clockwise from +x of its world
        self.home_altitude: float | None = None
        self._navigation: NavigationReport | None = None  # of the action in progress
        self.heard: float | None = None
        self._mark: PoseReport | None = None  # start of the present speed measurement
        self._speed: float | None = None

    def update(self, report: Report) -> None:
        """Record the contents of a report."""
        match report:
            case PoseReport():
                self.position, self.heading = report.position, report.rotation.yaw
                self._measure(report)
            case BatteryReport():
                self.battery = report.percent
            case FlightControllerReport():
                self.mode, self.armed = report.mode, report.armed
                self.autopilot, self.vehicle = report.autopilot, report.vehicle
                self.home_altitude = report.home.altitude if report.home else None
            case FlightStateReport():
                self.mode = report.flight_mode or self.mode
            case NavigationReport() if not report.state.terminal:
                self._navigation = report
            case NavigationReport() if (
                self._navigation is not None and self._navigation.action_id == report.action_id
            ):
                self._navigation = None
            case _:
                pass

    def with_remaining_distance(self, report: MetricsReport) -> MetricsReport:
        """Return metrics with the remaining distance and time of the present goal, where they are known."""
        if self._navigation is None:
            return report
        left = {"distance_remaining_m": self._navigation.remaining, "eta_seconds": self._navigation.eta}
        known = {name: round(value, 2) for name, value in left.items() if value is not None}
        return msgspec.structs.replace(report, navigation={**report.navigation, **known})

    def _measure(self, pose: PoseReport) -> None:
        """Measure the speed by the poses' own stamps, so that delayed poses do not look fast."""
        if self._mark is None or not 0.0 <= pose.stamp - self._mark.stamp <= GAP:
            self._mark, self._speed = pose, None
            return
        elapsed = pose.stamp - self._mark.stamp
        if elapsed >= MEASURED:
            self._speed = (pose.position - self._mark.position).norm() / elapsed
            self._mark = pose

    def speed(self, now: float) -> float | None:
        """Return the speed in m/s at ``now`` (Unix s); None while unknown, also after poses have ended."""
        if self._mark is None or abs(now - self._mark.stamp) > STALE + MEASURED:
            return None
        return self._speed

    def age(self, now: float) -> float | None:
        """Return the seconds since the last report (``now``: monotonic s); None before the first."""
        return None if self.heard is None else max(0.0, now - self.heard)


def is_known(report: Report) -> bool:
    """Return False for a pose with NaN or infinity, which can neither guide a robot nor be fenced."""
    if not isinstance(report, PoseReport):
        return True
    at, turned = report.position, report.rotation
    return math.isfinite(at.x + at.y + at.z + turned.w + turned.x + turned.y + turned.z)


def rounded(value: float | None) -> float | None:
    """Return a number rounded for display."""
    return None if value is None else round(value, 2)
