"""Converts a base's feedback to reports; pure except for the state of the odometry."""

from __future__ import annotations

from collections.abc import Iterator

from fleet import BatteryReport, ImuReport, JointReport, MetricsReport, PoseReport, Report, Vector3
from fleet_ugv.battery import percent
from fleet_ugv.config import UgvConfig
from fleet_ugv.model import Feedback
from fleet_ugv.odometry import OdometryStep, WheelOdometry

JOINTS_EVERY = 0.1  # s
BATTERY_EVERY = 2.0  # s
METRICS_EVERY = 1.0  # s


class FeedbackReporter:
    """Known state of one base.

    ``camera``: last commanded angles of the mount (pan, tilt), rad; ``mount``: measured angles.
    """

    def __init__(self, config: UgvConfig, odometry: WheelOdometry) -> None:
        self.odometry = odometry
        self.camera: tuple[float, float] | None = None
        self.mount: tuple[float, float] | None = None
        self.voltage: float | None = None
        self.speed = 0.0
        self.yaw_rate = 0.0
        self._temperature: float | None = None
        self._curve = config.battery or config.base.curve
        self._radius = config.setting.diameter / 2
        self._due: dict[str, float] = {}

    def update(self, feedback: Feedback, now: float) -> OdometryStep | None:
        """Integrate a feedback measured at ``now`` (monotonic s)."""
        step = self.odometry.update(feedback, now)
        if step is not None:
            self.speed, self.yaw_rate = step.speed, step.yaw_rate
        self.voltage = feedback.voltage if feedback.voltage is not None else self.voltage
        self._temperature = feedback.temperature
        if feedback.pan is not None and feedback.tilt is not None:
            self.mount = (feedback.pan, feedback.tilt)
        return step

    def reports(self, feedback: Feedback, now: float, stamp: float) -> Iterator[Report]:
        """Yield the reports that are due after a feedback."""
        pose = self.odometry.pose
        yield PoseReport(stamp, pose.position, pose.rotation)
        if self._is_due("joints", now, JOINTS_EVERY):
            yield self._joints(feedback, stamp)
            if feedback.gyro is not None and feedback.accel is not None:
                turning = self.odometry.level(feedback.gyro.z)
                yield ImuReport(stamp, Vector3(feedback.gyro.x, feedback.gyro.y, turning), feedback.accel)
        if self.voltage is not None and self._is_due("battery", now, BATTERY_EVERY):
            yield self.battery(stamp)

    def battery(self, stamp: float) -> BatteryReport:
        """Return the battery report, with the values that are known."""
        full = percent(self.voltage, self._curve) if self.voltage is not None and self._curve else None
        return BatteryReport(stamp, percent=full, voltage=self.voltage)

    def metrics(self, stamp: float, errors: tuple[dict[str, object], ...]) -> MetricsReport:
        """Return the metrics report."""
        odometry, battery = self.odometry, self.battery(stamp)
        power = {
            "battery_percent": battery.percent,
            "voltage": battery.voltage,
            "temperature": self._temperature,
        }
        navigation = {
            "speed": round(self.speed, 3),
            "yaw_rate": round(self.yaw_rate, 3),
            "position_sigma_m": round(odometry.position_sigma, 3),
            "heading_sigma_rad": round(odometry.heading_sigma, 4),
        }
        known = {name: value for name, value in power.items() if value is not None}
        return MetricsReport(stamp, known, navigation, errors)

    def metrics_due(self, now: float) -> bool:
        """Return True once a second."""
        return self._is_due("metrics", now, METRICS_EVERY)

    def _joints(self, feedback: Feedback, stamp: float) -> JointReport:
        """Return the joints of wheels and mount; the mount's measured angles, else the commanded ones."""
        left, right = self.odometry.travelled
        positions = {"left_wheel": left / self._radius, "right_wheel": right / self._radius}
        velocities = {}
        if feedback.speeds is not None:
            left, right = self.odometry.scaled(feedback.speeds)
            velocities = {"left_wheel": left / self._radius, "right_wheel": right / self._radius}
        if feedback.pan is not None and feedback.tilt is not None:
            positions |= {"pan": feedback.pan, "tilt": feedback.tilt}
        elif self.camera is not None:
            positions |= {"pan": self.camera[0], "tilt": self.camera[1]}
        return JointReport(stamp, positions, velocities)

    def _is_due(self, what: str, now: float, every: float) -> bool:
        """Return True at most once in ``every`` seconds."""
        if now < self._due.get(what, 0.0):
            return False
        self._due[what] = now + every
        return True
