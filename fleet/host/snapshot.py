"""What a robot looks like to people, gathered from the reports that pass."""

from __future__ import annotations

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


class Snapshot:
    """The last mode, arming, battery, position and home (m AMSL) of one robot."""

    def __init__(self) -> None:
        self.mode = ""
        self.armed: bool | None = None
        self.battery: float | None = None
        self.position: Vector3 | None = None
        self.home_altitude: float | None = None
        self._way: NavigationReport | None = None  # of the action under way

    def take(self, report: Report) -> None:
        """Note what a report says."""
        match report:
            case PoseReport():
                self.position = report.position
            case BatteryReport():
                self.battery = report.percent
            case FlightControllerReport():
                self.mode, self.armed = report.mode, report.armed
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
