"""Schedule of a vehicle's reports: each at its rate, and changes at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec

from fleet import (
    FlightControllerReport,
    GeoOrigin,
    GpsReport,
    ImuReport,
    JointReport,
    MetricsReport,
    PoseReport,
    Report,
    Robot,
    TelemetryReport,
)
from fleet_mavlink import reports
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.motors import Motors
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.vehicle_kind import VehicleKind

_CHANGES = 0.2  # s between checks for changes
_REFRESH = 5.0  # s after which the flight controller's state is reported again
_REPEAT = 0.9  # s after which the vehicle's state is reported again: at the last check of each second
_LAST_SENTENCES = 8  # texts in the flight controller's state


class Reporter:
    """Reports of one vehicle; while it does not answer, only its loss is reported."""

    def __init__(
        self,
        vehicle: Vehicle,
        config: MavlinkConfig,
        robot: Robot,
        origin: Callable[[], GeoOrigin | None],
        counts: Callable[[], Mapping[str, int]],
    ) -> None:
        self._vehicle = vehicle
        self._rates = config.rates
        self._motors = Motors(config.motor_joints)
        self._counts = counts
        self._robot = robot
        self._origin = origin
        self._controller: FlightControllerReport | None = None
        self._controller_at = 0.0
        self._state: TelemetryReport | None = None
        self._state_at = 0.0

    def begin(self) -> None:
        """Register all periodic reports with the host's tick scheduler."""
        rates = self._rates
        self._every(1 / rates.pose, self._pose)
        self._every(1 / rates.gps, lambda state, _, now: self._gps(state, now))
        self._every(1 / rates.battery, lambda state, _, now: reports.battery_report(state, now))
        self._every(1 / rates.state, reports.flight_state_report)
        self._every(1 / rates.metrics, self._metrics)
        if rates.imu:
            self._every(1 / rates.imu, self._imu)
        if rates.motors:
            self._every(1 / rates.motors, self._joints)
        self._robot.every(_CHANGES, self._report_changes)

    def battery(self) -> bool:
        """Report the battery now; False while it is unknown."""
        report = reports.battery_report(self._vehicle.state, self._robot.clock.time())
        if report is not None:
            self._robot.report(report)
        return report is not None

    def report_text(self, sentence: Sentence) -> None:
        """Report a text of the autopilot."""
        self._robot.report(reports.log_report(sentence, self._robot.clock.time()))

    def _pose(self, state: VehicleState, _kind: VehicleKind, stamp: float) -> PoseReport | None:
        """Return the pose; an outdated position is not reported again with a new time stamp."""
        if not state.knows_where(self._vehicle.now()):
            return None
        return reports.pose_report(state, self._origin(), stamp)

    def _gps(self, state: VehicleState, stamp: float) -> GpsReport | None:
        """Return the fix, or a report without one."""
        return reports.gps_report(state, self._vehicle.now(), stamp)

    def _metrics(self, state: VehicleState, kind: VehicleKind, stamp: float) -> MetricsReport:
        """Return the metrics, with the error counts."""
        return reports.metrics_report(state, kind, stamp, self._counts())

    def _imu(self, state: VehicleState, _kind: VehicleKind, stamp: float) -> ImuReport | None:
        """Return body rates and accelerations."""
        return reports.imu_report(state, self._vehicle.now(), stamp)

    def _joints(self, state: VehicleState, _kind: VehicleKind, stamp: float) -> JointReport | None:
        """Return the motors."""
        return self._motors.report(state.sensors, self._vehicle.now(), stamp)

    def _every(
        self, seconds: float, make: Callable[[VehicleState, VehicleKind, float], Report | None]
    ) -> None:
        """Report something periodically, while it is known."""

        def tell() -> None:
            kind = self._vehicle.kind
            if kind is None or not self._vehicle.connected:
                return
            report = make(self._vehicle.state, kind, self._robot.clock.time())
            if report is not None:
                self._robot.report(report)

        self._robot.every(seconds, tell)

    def _report_changes(self) -> None:
        """Report changed states at once, unchanged ones periodically."""
        kind = self._vehicle.kind
        if kind is None:
            return
        self._report_controller(kind)
        if self._vehicle.connected:
            self._report_state(kind)

    def _report_controller(self, kind: VehicleKind) -> None:
        """Report the flight controller's state, also its loss."""
        report = reports.flight_controller_report(
            self._vehicle.state,
            kind,
            list(self._vehicle.sentences)[-_LAST_SENTENCES:],
            self._vehicle.system,
            connected=self._vehicle.connected,
            stamp=self._robot.clock.time(),
        )
        now = self._vehicle.now()
        if report is None or (_same(report, self._controller) and now - self._controller_at < _REFRESH):
            return
        self._controller, self._controller_at = report, now
        self._robot.report(report)

    def _report_state(self, kind: VehicleKind) -> None:
        """Report the vehicle's state for the telemetry topic; a changed altitude alone is not a change."""
        now = self._vehicle.now()
        report = reports.vehicle_state_report(self._vehicle.state, kind, now, self._robot.clock.time())
        known = self._state.fields if self._state else {}
        changed = {name for name, value in report.fields.items() if known.get(name) != value}
        if changed <= {"altitude_m"} and now - self._state_at < _REPEAT:
            return
        self._state, self._state_at = report, now
        self._robot.report(report)


def _same(one: FlightControllerReport, other: FlightControllerReport | None) -> bool:
    """Return True if two states differ in nothing but their time stamp."""
    return other is not None and msgspec.structs.replace(other, stamp=one.stamp) == one
