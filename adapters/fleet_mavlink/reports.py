"""Converts a vehicle's state to reports; unknown values are left out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    GeoOrigin,
    GpsReport,
    ImuReport,
    LogReport,
    MetricsReport,
    MissionProgress,
    PoseReport,
    StatusText,
    TelemetryReport,
)
from fleet_mavlink.constants import type_name
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence
from fleet_mavlink.vehicle_kind import VehicleKind
from fleet_mavlink.world_frame import flu_from_frd, pose_of

NO_FIX = "none"  # fix type of a receiver without a fix
_IMU_FRESH = 1.0  # s
_LEVELS = ("CRITICAL", "CRITICAL", "CRITICAL", "ERROR", "WARNING", "INFO", "INFO", "DEBUG")


def pose_report(state: VehicleState, origin: GeoOrigin | None, stamp: float) -> PoseReport | None:
    """Return the pose in the world frame."""
    pose = pose_of(state, origin) if origin is not None else None
    return PoseReport(stamp, pose.position, pose.rotation) if pose is not None else None


def gps_report(state: VehicleState, now: float, stamp: float) -> GpsReport | None:
    """Return the satellite fix, or a report without one, at monotonic ``now``; None without a receiver."""
    fix = state.fix_now(now)
    if fix is None:
        return GpsReport(stamp, point=None, fix_type=NO_FIX) if state.fix_reported(now) else None
    return GpsReport(
        stamp,
        point=fix.point,
        fix_type=fix.kind,
        satellites=fix.satellites,
        heading=state.heading,
        horizontal_accuracy=fix.horizontal_accuracy,
        vertical_accuracy=fix.vertical_accuracy,
    )


def battery_report(state: VehicleState, stamp: float) -> BatteryReport | None:
    """Return the battery."""
    battery = state.battery
    if battery.percent is None and battery.voltage is None:
        return None
    return BatteryReport(stamp, battery.percent, battery.voltage, battery.current)


def flight_state_report(state: VehicleState, kind: VehicleKind, stamp: float) -> FlightStateReport | None:
    """Return whether it flies."""
    if state.in_air is None:
        return None
    return FlightStateReport(stamp, is_flying=state.in_air, flight_mode=kind.mode_of(state))


def flight_controller_report(
    state: VehicleState,
    kind: VehicleKind,
    sentences: Iterable[Sentence],
    system: int,
    *,
    connected: bool,
    stamp: float,
) -> FlightControllerReport | None:
    """Return the autopilot's slowly changing state."""
    beat = state.heartbeat
    if beat is None:
        return None
    mission = None
    if state.mission_current is not None and state.mission_total is not None:
        mission = MissionProgress(state.mission_current, state.mission_total, state.mission_reached)
    return FlightControllerReport(
        stamp,
        armed=state.armed,
        mode=kind.mode_of(state),
        failsafe=state.failsafe,
        autopilot=kind.name,
        vehicle=type_name(beat.type),
        custom_mode=beat.custom_mode,
        system_status=beat.system_status,
        ready_to_arm=kind.ready_to_arm(state),
        status_texts=tuple(StatusText(said.text, said.severity) for said in sentences),
        connected=connected,
        system_id=system,
        reboots=state.reboots,
        mission=mission,
        home=state.home,
    )


def imu_report(state: VehicleState, now: float, stamp: float) -> ImuReport | None:
    """Return body rates and acceleration, FLU; None if they are older than 1 s at monotonic ``now``."""
    imu = state.sensors.imu
    if imu is None or now - state.sensors.imu_at > _IMU_FRESH:
        return None
    return ImuReport(stamp, gyro=flu_from_frd(imu.gyro), accel=flu_from_frd(imu.accel))


def metrics_report(
    state: VehicleState, kind: VehicleKind, stamp: float, counts: Mapping[str, int] | None = None
) -> MetricsReport:
    """Return the metrics, only known ones; ``counts``: error counts by name."""
    errors = tuple({"type": what, "count": count} for what, count in (counts or {}).items() if count)
    battery = state.battery
    lasts = None if battery.charging else battery.seconds_left
    power = {
        "battery_percent": battery.percent,
        "voltage": battery.voltage,
        "current": battery.current,
        "charging": battery.charging,
        "estimated_runtime_minutes": None if lasts is None else round(lasts / 60, 1),
    }
    navigation = {
        "status": kind.mode_of(state),
        "altitude_m": _height(state),
        "ground_speed_ms": state.velocity.horizontal() if state.velocity else None,
        "heading_deg": state.heading,
    }
    return MetricsReport(stamp, power=_known(power), navigation=_known(navigation), errors=errors)


def vehicle_state_report(state: VehicleState, kind: VehicleKind, now: float, stamp: float) -> TelemetryReport:
    """Return the ``vehicle_state`` telemetry at monotonic ``now``: known values only."""
    fix = state.fix_now(now)
    fields = {
        "armed": state.armed,
        "mode": kind.mode_of(state),
        "in_air": state.in_air,
        "altitude_m": _height(state),
        "ready_to_arm": kind.ready_to_arm(state),
        "failsafe": state.failsafe,
        "vehicle": type_name(state.heartbeat.type) if state.heartbeat else None,
        "gps_fix": (fix.kind if fix else NO_FIX) if state.fix_reported(now) else None,
        "position_usable": kind.position_usable(state, now),
    }
    return TelemetryReport(stamp, "vehicle_state", _known(fields))


def _height(state: VehicleState) -> float | None:
    """Return metres above home, None for a vehicle on the surface."""
    return None if state.on_the_surface else state.relative_altitude


def log_report(sentence: Sentence, stamp: float) -> LogReport:
    """Return a text of the autopilot as a log message."""
    level = _LEVELS[min(sentence.severity, len(_LEVELS) - 1)]
    return LogReport(stamp, level, sentence.text)


def _known(fields: Mapping[str, object]) -> dict[str, object]:
    """Return the fields that are known."""
    return {name: value for name, value in fields.items() if value is not None}
