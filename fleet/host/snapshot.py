"""What a robot looks like to people, gathered from the reports that pass."""

from __future__ import annotations

from fleet.model.geometry import Vector3
from fleet.model.report import BatteryReport, FlightControllerReport, FlightStateReport, PoseReport, Report

MEASURED = 0.5  # s of way that make a speed
GAP = 2.0  # s without a pose after which what lies between says nothing of the speed
STALE = 2.0  # s after which a speed is no longer that of now


class Snapshot:
    """The last mode, arming, battery, position, speed and home (m AMSL) of one robot.

    ``heard`` is when it last said anything (monotonic s); None while it never did.
    """

    def __init__(self) -> None:
        self.mode = ""
        self.armed: bool | None = None
        self.battery: float | None = None
        self.position: Vector3 | None = None
        self.home_altitude: float | None = None
        self.heard: float | None = None
        self._mark: PoseReport | None = None  # from which the next speed is measured
        self._speed: float | None = None

    def take(self, report: Report) -> None:
        """Note what a report says."""
        match report:
            case PoseReport():
                self.position = report.position
                self._measure(report)
            case BatteryReport():
                self.battery = report.percent
            case FlightControllerReport():
                self.mode, self.armed = report.mode, report.armed
                self.home_altitude = report.home.altitude if report.home else None
            case FlightStateReport():
                self.mode = report.flight_mode or self.mode
            case _:
                pass

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
