"""Messages that the vehicle sends by itself: one builder for each, and the requested rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, place_of
from fleet_mavlink.sim.physics import GRAVITY

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

Builder = Callable[["Autopilot"], Any]  # returns the message, or None without data


def _heading_cdeg(pilot: Autopilot) -> int:
    return int(math.degrees(pilot.body.heading) * 100) % 36000


def heartbeat(pilot: Autopilot) -> object:
    """HEARTBEAT: mode, armed, and system status."""
    base = pilot.mode.base | (mav.MAV_MODE_FLAG_SAFETY_ARMED if pilot.armed else 0)
    return mav.MAVLink_heartbeat_message(
        pilot.vehicle_type, pilot.autopilot_id, base, pilot.mode.custom, pilot.status.state(), 3
    )


def sys_status(pilot: Autopilot) -> object:
    """SYS_STATUS: sensor health with the PREARM_CHECK bit, battery."""
    present, enabled, health = pilot.status.sensors()
    battery = pilot.battery
    return mav.MAVLink_sys_status_message(
        present,
        enabled,
        health,
        320,
        int(battery.volts * 1000),
        int(battery.amperes * 100),
        battery.whole_percent,
        *(0, 0, 0, 0, 0, 0),
    )


def gps_raw_int(pilot: Autopilot) -> object:
    """GPS_RAW_INT: measurement of the receiver, with noise."""
    lost, loss = pilot.gps.lost_for, pilot.gps.profile.loss
    if lost is not None and lost >= loss.shown:
        place = tuple(int(each * scale) for each, scale in zip(pilot.geo(), (1e7, 1e7, 1e3), strict=True))
        return mav.MAVLink_gps_raw_int_message(
            pilot.uptime.us, loss.fix, *place, loss.error, loss.error, 0, 65535, loss.count
        )
    if not pilot.gps.fix and lost is None:
        unknown = 65535
        return mav.MAVLink_gps_raw_int_message(
            pilot.uptime.us, 1 if pilot.initialised else 0, 0, 0, 0, unknown, unknown, unknown, unknown, 0
        )
    latitude, longitude, altitude = pilot.geo()
    noise = pilot.random.gauss(0.0, 1.0)
    return mav.MAVLink_gps_raw_int_message(
        pilot.uptime.us,
        pilot.gps.profile.fix_type,
        int(latitude * 1e7 + noise),
        int(longitude * 1e7 - noise),
        int(altitude * 1000 + 20 * noise),
        121,
        200,
        int(pilot.body.speed * 100),
        int(math.degrees(math.atan2(pilot.body.ve, pilot.body.vn)) * 100) % 36000,
        10,
        int(altitude * 1000),
        300,
        300,
        40,
    )


def global_position_int(pilot: Autopilot) -> object:
    """GLOBAL_POSITION_INT: the estimate; ArduPilot sends 0/0 before it has an origin."""
    if not pilot.home.known:
        return mav.MAVLink_global_position_int_message(
            pilot.uptime.ms, 0, 0, 0, 0, 0, 0, 0, _heading_cdeg(pilot)
        )
    latitude, longitude, altitude = pilot.geo(pilot.gps.drift.east)
    body = pilot.body
    return mav.MAVLink_global_position_int_message(
        pilot.uptime.ms,
        int(latitude * 1e7),
        int(longitude * 1e7),
        int(altitude * 1000),
        int(pilot.home.height() * 1000),
        int(body.vn * 100),
        int((body.ve + pilot.gps.drift.speed) * 100),
        int(body.vd * 100),
        _heading_cdeg(pilot),
    )


def local_position_ned(pilot: Autopilot) -> object:
    """LOCAL_POSITION_NED: metres from the estimator's origin; None before there is one.

    Without satellites, ArduPilot stops sending it, PX4 drifts away.
    """
    gave_up = pilot.autopilot_id == mav.MAV_AUTOPILOT_ARDUPILOTMEGA and pilot.gps.drift.speed
    if not pilot.home.known or gave_up:
        return None
    body, drift = pilot.body, pilot.gps.drift
    place = (body.north, body.east + drift.east, body.down)
    return mav.MAVLink_local_position_ned_message(
        pilot.uptime.ms, *place, body.vn, body.ve + drift.speed, body.vd
    )


def _signed(heading: float) -> float:
    """Return a heading in (-pi, pi]."""
    return math.remainder(heading, math.tau)


def attitude(pilot: Autopilot) -> object:
    """ATTITUDE: roll, pitch, yaw in radians."""
    body = pilot.body
    return mav.MAVLink_attitude_message(
        pilot.uptime.ms, body.roll, body.pitch, _signed(body.heading), 0.0, 0.0, body.turn_rate
    )


def attitude_quaternion(pilot: Autopilot) -> object:
    """ATTITUDE_QUATERNION: the same, as w x y z."""
    body = pilot.body
    cr, sr = math.cos(body.roll / 2), math.sin(body.roll / 2)
    cp, sp = math.cos(body.pitch / 2), math.sin(body.pitch / 2)
    cy, sy = math.cos(_signed(body.heading) / 2), math.sin(_signed(body.heading) / 2)
    return mav.MAVLink_attitude_quaternion_message(
        pilot.uptime.ms,
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        0.0,
        0.0,
        body.turn_rate,
    )


def vfr_hud(pilot: Autopilot) -> object:
    """VFR_HUD: speed, heading, altitude above sea level, climb."""
    body = pilot.body
    return mav.MAVLink_vfr_hud_message(
        0.0,
        body.speed,
        int(math.degrees(body.heading)) % 360,
        50 if pilot.armed and not body.grounded else 0,
        pilot.geo()[2],
        -body.vd,
    )


def battery_status(pilot: Autopilot) -> object:
    """BATTERY_STATUS: volts of the pack in the first cell, remaining percent and seconds."""
    battery = pilot.battery
    volts = [int(battery.volts * 1000)] + [65535] * 9
    return mav.MAVLink_battery_status_message(
        0,
        1,
        1,
        32767,
        volts,
        int(battery.amperes * 100),
        int(battery.used_mah),
        -1,
        battery.whole_percent,
        time_remaining=int(battery.seconds_left),
        charge_state=mav.MAV_BATTERY_CHARGE_STATE_OK,
    )


def extended_sys_state(pilot: Autopilot) -> object:
    """EXTENDED_SYS_STATE: VTOL state; on the ground, taking off, in the air, landing."""
    return mav.MAVLink_extended_sys_state_message(pilot.vtol_state(), pilot.land_detector.state())


def home_position(pilot: Autopilot) -> object:
    """HOME_POSITION: None before home is known."""
    if pilot.home.place is None:
        return None
    north, east, down = pilot.home.ned()
    latitude, longitude, altitude = pilot.home.place
    return mav.MAVLink_home_position_message(
        int(latitude * 1e7),
        int(longitude * 1e7),
        int(altitude * 1000),
        north,
        east,
        down,
        [1.0, 0.0, 0.0, 0.0],
        0.0,
        0.0,
        0.0,
        pilot.uptime.us,
    )


def mission_current(pilot: Autopilot) -> object:
    """MISSION_CURRENT: progress of the mission."""
    missions = pilot.missions
    return mav.MAVLink_mission_current_message(
        missions.current, missions.total, missions.state, 1 if pilot.runs_mission else 2
    )


def ekf_status_report(pilot: Autopilot) -> object:
    """EKF_STATUS_REPORT (ArduPilot only): 0x33f with a position, 0xa7 without."""
    if pilot.autopilot_id != mav.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return None
    flags = pilot.gps.drift.flags(pilot.gps.lost_for, usable=pilot.has_position)
    return mav.MAVLink_ekf_status_report_message(flags, 0.01, 0.01, 0.01, 0.01, 0.0)


def estimator_status(pilot: Autopilot) -> object:
    """ESTIMATOR_STATUS (PX4 only)."""
    if pilot.autopilot_id != mav.MAV_AUTOPILOT_PX4:
        return None
    flags = pilot.gps.drift.flags(pilot.gps.lost_for, usable=pilot.has_position)
    return mav.MAVLink_estimator_status_message(
        pilot.uptime.us, flags, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.3, 0.3
    )


def system_time(pilot: Autopilot) -> object:
    """SYSTEM_TIME: Unix time is 0 before satellites provide it."""
    unix = int(pilot.uptime.unix * 1e6) if pilot.gps.fix else 0
    return mav.MAVLink_system_time_message(unix, pilot.uptime.ms)


def autopilot_version(pilot: Autopilot) -> object:
    """AUTOPILOT_VERSION: capabilities and version."""
    custom = list(b"92b0cd78")
    return mav.MAVLink_autopilot_version_message(
        pilot.capabilities, pilot.version, 0, 0, 0, custom, [0] * 8, [0] * 8, 0, 0, pilot.system_id
    )


def gps_global_origin(pilot: Autopilot) -> object:
    """GPS_GLOBAL_ORIGIN: origin of LOCAL_POSITION_NED; None before there is one."""
    if not pilot.home.known:
        return None
    latitude, longitude, altitude = pilot.place
    return mav.MAVLink_gps_global_origin_message(
        int(latitude * 1e7), int(longitude * 1e7), int(altitude * 1000), pilot.uptime.us
    )


def _thrust(pilot: Autopilot) -> float:
    """Return the upward reading of the accelerometer, m/s2: ground or motors carry the vehicle."""
    body = pilot.body
    return GRAVITY / (math.cos(body.roll) * math.cos(body.pitch))


def raw_imu(pilot: Autopilot) -> object:
    """RAW_IMU in ArduPilot's units (thousandths of g and of rad/s); PX4 is not asked for it."""
    accel, turn = round(-1000 * _thrust(pilot) / GRAVITY), round(1000 * pilot.body.turn_rate)
    return mav.MAVLink_raw_imu_message(pilot.uptime.us, 0, 0, accel, 0, 0, turn, 224, 80, -528)


def highres_imu(pilot: Autopilot) -> object:
    """HIGHRES_IMU (PX4 only)."""
    if pilot.autopilot_id != mav.MAV_AUTOPILOT_PX4:
        return None
    motion = (0.0, 0.0, -_thrust(pilot), 0.0, 0.0, pilot.body.turn_rate)
    return mav.MAVLink_highres_imu_message(
        pilot.uptime.us, *motion, 0.2, 0.1, -0.5, 956.0, 0.0, 488.0, 25.0, 0x1FFF
    )


def esc_telemetry(pilot: Autopilot) -> object:
    """ESC_TELEMETRY_1_TO_4 (ArduPilot only): the motors stand, idle, or carry the vehicle."""
    if pilot.autopilot_id != mav.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return None
    rpm = (5200 if pilot.flying else 1200) if pilot.armed else 0
    volts = int(pilot.battery.volts * 100)
    return mav.MAVLink_esc_telemetry_1_to_4_message(
        [32] * 4, [volts] * 4, [80] * 4, [1] * 4, [rpm] * 4, [0] * 4
    )


def position_target(pilot: Autopilot) -> object:
    """POSITION_TARGET_GLOBAL_INT: target position of the vehicle, None without one."""
    flown = pilot.manoeuvre
    if not isinstance(flown, GoToManoeuvre):
        return None
    latitude, longitude, altitude = pilot.frame.geo_of(place_of(flown))
    return mav.MAVLink_position_target_global_int_message(
        pilot.uptime.ms, 0, 0xFDF8, int(latitude * 1e7), int(longitude * 1e7), altitude, *([0.0] * 8)
    )


BUILDERS: Mapping[int, Builder] = {
    mav.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: position_target,
    mav.MAVLINK_MSG_ID_RAW_IMU: raw_imu,
    mav.MAVLINK_MSG_ID_HIGHRES_IMU: highres_imu,
    mav.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4: esc_telemetry,
    mav.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mav.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mav.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    mav.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    mav.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
    mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    mav.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    mav.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    mav.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status_report,
    mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS: estimator_status,
    mav.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
}
# REQUEST_DATA_STREAM (ArduPilot): messages of each stream id
DATA_STREAMS: Mapping[int, tuple[int, ...]] = {
    2: (1, 24, 42, 74, 193),  # extended status
    6: (32, 33),  # position
    10: (30,),  # extra 1
    11: (74,),  # extra 2
    12: (2, 147, 193),  # extra 3
}
ALL_STREAMS = tuple(sorted({message for group in DATA_STREAMS.values() for message in group}))


class SimStreams:
    """Rates of the messages that are sent periodically, with the due time of each."""

    def __init__(self, rates: Mapping[int, float], now: float) -> None:
        self._defaults = dict(rates)
        self._every: dict[int, float] = {}
        self._due: dict[int, float] = {}
        for message_id, rate in rates.items():
            self.set(message_id, 1.0 / rate, now)

    def set(self, message_id: int, every: float, now: float) -> None:
        """Send a message every ``every`` seconds from now on; 0 or less: not periodically."""
        self._due.pop(message_id, None)
        self._every.pop(message_id, None)
        if every > 0.0:
            self._every[message_id] = every
            self._due[message_id] = now

    def reset(self, message_id: int, now: float) -> None:
        """Restore the default rate of a message."""
        rate = self._defaults.get(message_id, 0.0)
        self.set(message_id, 1.0 / rate if rate else 0.0, now)

    def every(self, message_id: int) -> float:
        """Return the period of a message, s; 0: it is not sent periodically."""
        return self._every.get(message_id, 0.0)

    def due(self, pilot: Autopilot, now: float) -> Iterable[object]:
        """Yield the messages that are due."""
        for message_id, due in self._due.items():
            if due > now:
                continue
            self._due[message_id] = max(due + self._every[message_id], now)
            message = BUILDERS[message_id](pilot)
            if message is not None:
                yield message
