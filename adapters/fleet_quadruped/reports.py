"""Conversion of body controller states to reports."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from fleet import (
    BatteryReport,
    Health,
    ImuReport,
    JointReport,
    Level,
    LogReport,
    MetricsReport,
    PoseReport,
    Quaternion,
    Robot,
    Vector3,
)
from fleet_quadruped.control.orders import DogState
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import EMERGENCY_STOP

SLOW_RATE = 0.8  # of the configured rate; below it fast walking is not safe


class MotionReports:
    """Fast reports: each measurement once, with its own time stamp.

    Silent drives and sensors are left out; so is a pose with an old part.
    """

    def __init__(self, trim: float) -> None:
        self._trim = trim
        self._measured: tuple[float, ...] = ()
        self._posed = self._felt = -math.inf

    def reports(self, state: DogState, epoch: float) -> Iterator[PoseReport | JointReport | ImuReport]:
        """Yield the new measurements in a state; ``epoch`` is Unix seconds at monotonic zero."""
        before, self._measured = self._measured or (-math.inf,) * len(state.measured), state.measured
        new = [number for number, at in enumerate(state.measured) if at > before[number]]
        if new:
            yield JointReport(
                epoch + min(state.measured[number] for number in new),
                {JOINTS[number]: state.angles[number] for number in new},
                {JOINTS[number]: state.speeds[number] for number in new},
                {JOINTS[number]: state.torques[number] for number in new},
            )
        if state.posed > self._posed:
            self._posed = state.posed
            position = Vector3(state.x * self._trim, state.y * self._trim, state.height)
            yield PoseReport(epoch + state.posed, position, Quaternion(*state.rotation))
        if state.felt > self._felt and state.gyro is not None and state.accel is not None:
            self._felt = state.felt
            yield ImuReport(epoch + state.felt, Vector3(*state.gyro), Vector3(*state.accel))


class BodyReporter:
    """Reports the states of a body controller; ``state`` returns the newest one."""

    def __init__(self, robot: Robot, trim: float, state: Callable[[], DogState]) -> None:
        self._robot = robot
        self._state = state
        self._motion = MotionReports(trim)
        self._origin = 0.0  # Unix s at which odometry was reset

    def begin(self) -> None:
        """Report that odometry starts from zero."""
        self._origin = self._robot.clock.time()
        self._robot.report(new_origin(self._origin))

    def report_motion(self) -> None:
        """Report the fast measurements, once there is a state."""
        if self._state().stamp:
            clock = self._robot.clock
            for report in self._motion.reports(self._state(), clock.time() - clock.monotonic()):
                self._robot.report(report)

    def report_slow(self) -> None:
        """Report the slow measurements, once there is a state."""
        if self._state().stamp:
            for report in slow_reports(self._state(), self._robot.clock.time(), self._origin):
                self._robot.report(report)


def new_origin(stamp: float) -> LogReport:
    """Return the log message about a reset of odometry: former positions have another origin."""
    return LogReport(stamp, "WARNING", "odometry was reset: position 0, 0 is where the dog is now")


def slow_reports(
    state: DogState, stamp: float, origin: float = 0.0
) -> Iterator[BatteryReport | MetricsReport]:
    """Yield the slow reports; ``origin``: Unix seconds at which odometry started at (0, 0)."""
    if state.battery and state.battery_age is not None and state.battery_age < 5.0:
        given = {
            name: state.battery[name] for name in ("percent", "voltage", "current") if name in state.battery
        }
        yield BatteryReport(stamp, **given)
    timing = state.timing
    navigation = {
        "mode": state.mode,
        "source": "leg_odometry",
        "origin": round(origin, 3),
        "velocity": list(state.twist),
        "realtime": timing.realtime,
        "cycle_rate": round(timing.rate, 1),
        "overruns": timing.overruns,
        "incomplete_cycles": timing.incomplete,
        "longest_cycle_ms": round(timing.worst * 1000, 2),
        "feedback_age_ms": round(timing.age * 1000, 1),
        "clamped_targets": timing.clamped,
        "dropped_frames": timing.dropped,
        **{f"bus_load_{bus}": round(load, 3) for bus, load in state.loads.items()},
    }
    temperatures = [value for value in state.temperatures if value is not None]
    power = {"hottest_joint": max(temperatures)} if temperatures else {}
    errors = ({"code": "body", "message": state.fault},) if state.fault else ()
    yield MetricsReport(stamp, power=power, navigation=navigation, errors=errors)


def health_of(state: DogState, cycle_hz: float) -> Health:
    """Return the health; after an emergency stop only the host's latch keeps the robot from moving."""
    if state.fault == EMERGENCY_STOP:
        return Health(Level.DEGRADED, state.fault)
    if state.fault:
        frames = f"; frames: {state.capture}" if state.capture else ""
        return Health(Level.FAULT, f"{state.fault}; look at the dog, then send reset_faults{frames}")
    if state.warning:
        return Health(Level.DEGRADED, state.warning)
    if 0 < state.timing.rate < SLOW_RATE * cycle_hz:
        return Health(
            Level.DEGRADED, f"the body loop reaches {state.timing.rate:.0f} of {cycle_hz:.0f} cycles a second"
        )
    return Health()
