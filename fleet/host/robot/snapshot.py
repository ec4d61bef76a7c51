"""What a robot looks like to people, gathered from the reports that pass."""

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

MEASURED = 0.5  # s of way that make a speed
GAP = 2.0  # s without a pose after which what lies between says nothing of the speed
STALE = 2.0  # s after which a speed is no longer that of now

READ = frozenset({PoseReport, BatteryReport, FlightStateReport, FlightControllerReport})
"""What the host itself reads of a robot's reports, to show it, to lead and to guard it; the rest passes."""


class Snapshot:
    """The last mode, autopilot, vehicle, arming, battery, position, speed and home (m AMSL) of one robot.

    ``heard`` is when it last said anything (monotonic s); None while it never did.
    """

    def __init__(self) -> None:
        self.mode = self.autopilot = self.vehicle = ""
        self.armed: bool | None = None
        self.battery: float | None = None
        self.position: Vector3 | None = None
        self.heading: float | None = None  # radians counter-clockwise from +x of its world
        self.home_altitude: float | None = None
        self._way: NavigationReport | None = None  # of the action under way
        self.heard: float | None = None
        self._mark: PoseReport | None = None  # from which the next speed is measured
        self._speed: float | None = None

    def take(self, report: Report) -> None:
        """Note what a report says."""
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
                self._way = report
            case NavigationReport() if self._way is not None and self._way.action_id == report.action_id:
                self._way = None
            case _:
                pass

    def with_way(self, report: MetricsReport) -> MetricsReport:
        """Return numbers for people with what is left of the goal under way, where its leader tells that."""
        if self._way is None:
            return report
        left = {"distance_remaining_m": self._way.remaining, "eta_seconds": self._way.eta}
        known = {name: round(value, 2) for name, value in left.items() if value is not None}
        return msgspec.structs.replace(report, navigation={**report.navigation, **known})

    def _measure(self, pose: PoseReport) -> None:
        """Measure the speed between poses: by their own stamps, so that late ones do not look fast."""
        if self._mark is None or not 0.0 <= pose.stamp - self._mark.stamp <= GAP:
            self._mark, self._speed = pose, None
            return
        elapsed = pose.stamp - self._mark.stamp
        if elapsed >= MEASURED:
            self._speed = (pose.position - self._mark.position).norm() / elapsed
            self._mark = pose

    def speed(self, now: float) -> float | None:
        """Return the speed in m/s at ``now`` (Unix s); None while unknown, also once poses end."""
        if self._mark is None or abs(now - self._mark.stamp) > STALE + MEASURED:
            return None
        return self._speed

    def age(self, now: float) -> float | None:
        """Return how many seconds ago the robot was heard (``now``: monotonic s); None while it never was."""
        return None if self.heard is None else max(0.0, now - self.heard)


def is_known(report: Report) -> bool:
    """Return False for a pose that is no place: nothing is led or kept within a fence by not-a-number."""
    if not isinstance(report, PoseReport):
        return True
    at, turned = report.position, report.rotation
    return math.isfinite(at.x + at.y + at.z + turned.w + turned.x + turned.y + turned.z)


def rounded(value: float | None) -> float | None:
    """Return a figure for people."""
    return None if value is None else round(value, 2)
