"""A state of the body controller as reports of the fleet."""

from __future__ import annotations

from collections.abc import Iterator

from fleet import BatteryReport, Health, Level, PoseReport, Quaternion, Vector3
from fleet.model.report import ImuReport, JointReport, MetricsReport
from fleet_quadruped.control.orders import State
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import EMERGENCY_STOP

SLOW_RATE = 0.8  # of the wanted rate, below which the dog is not safe to walk fast


def motion_reports(state: State, stamp: float, trim: float) -> Iterator[PoseReport | JointReport | ImuReport]:
    """Yield what changes all the time; ``stamp`` is Unix seconds."""
    if state.angles:
        yield JointReport(
            stamp,
            dict(zip(JOINTS, state.angles, strict=True)),
            dict(zip(JOINTS, state.speeds, strict=True)),
            dict(zip(JOINTS, state.torques, strict=True)),
        )
    position = Vector3(state.x * trim, state.y * trim, state.height)
    yield PoseReport(stamp, position, Quaternion(*state.rotation))
    if state.gyro is not None and state.accel is not None:
        yield ImuReport(stamp, Vector3(*state.gyro), Vector3(*state.accel))


def slow_reports(state: State, stamp: float) -> Iterator[BatteryReport | MetricsReport]:
    """Yield what changes slowly."""
    if state.battery and state.battery_age is not None and state.battery_age < 5.0:
        given = {
            name: state.battery[name] for name in ("percent", "voltage", "current") if name in state.battery
        }
        yield BatteryReport(stamp, **given)
    timing = state.timing
    navigation = {
        "mode": state.mode,
        "source": "leg_odometry",
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


def health_of(state: State, cycle_hz: float) -> Health:
    """Return how the dog is; of an emergency stop that is over only the host's latch keeps it from moving."""
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
