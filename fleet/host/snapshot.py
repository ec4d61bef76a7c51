"""What a robot looks like to people, gathered from the reports that pass."""

from __future__ import annotations

from fleet.model.geometry import Vector3
from fleet.model.report import BatteryReport, FlightControllerReport, FlightStateReport, PoseReport, Report


class Snapshot:
    """The last mode, arming, battery, position and home (m AMSL) of one robot."""

    def __init__(self) -> None:
        self.mode = ""
        self.armed: bool | None = None
        self.battery: float | None = None
        self.position: Vector3 | None = None
        self.home_altitude: float | None = None

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
            case _:
                pass
