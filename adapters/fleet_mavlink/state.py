"""State of one vehicle: an immutable value, and the reducers of its messages. No I/O, no clock."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet import GeoPoint, Vector3
from fleet_mavlink.broadcast_messages import OpenDroneIdArmStatus
from fleet_mavlink.constants import (
    ARMED_FLAG,
    FIX_TYPES,
    ON_THE_SURFACE,
    PREARM_OK,
    RC_RECEIVER,
    Landed,
    Status,
)
from fleet_mavlink.messages import (
    Attitude,
    BatteryStatus,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    MavlinkMessage,
    MissionCurrent,
    MissionItemReached,
    SysStatus,
    SystemTime,
)
from fleet_mavlink.onboard_sensors import CHANGES as CARRIED
from fleet_mavlink.onboard_sensors import OnboardSensors, reduce_sensors
from fleet_mavlink.transfer_messages import ParamValue

SILENCE = 3.0  # s without a heartbeat after which the vehicle counts as lost
_BEATS_TO_RETURN = 2
_FRESH = 1.0  # s for which a position or attitude may be used for control
_BACKWARDS = 2000  # ms; a larger decrease of the time since boot means a reboot
_CLOCK_WRAP = 0xFFFF_0000  # ms; beyond it the 32-bit clock wraps without a reboot
_FIX_FRESH = 5.0  # s without a message of the satellite receiver after which its fix counts as lost
_ABSOLUTE_POSITION = 0x10  # estimator flag
_UNKNOWN_16 = 65535
_LANDED = {int(each): each for each in Landed}
_UNDEFINED, _ON_GROUND = Landed.UNDEFINED, Landed.ON_GROUND  # lookups on an enumeration are slow
_CHARGING = 7  # MAV_BATTERY_CHARGE_STATE
SETTINGS = frozenset(
    {
        "AIRSPEED_CRUISE",
        "AIRSPEED_MAX",
        "AIRSPEED_MIN",
        "FW_AIRSPD_MAX",
        "FW_AIRSPD_MIN",
        "FW_AIRSPD_TRIM",
        "NAV_LOITER_RAD",
        "Q_ASSIST_SPEED",
        "Q_GUIDED_MODE",
        "Q_TRANS_DECEL",
        "Q_WP_SPEED",
        "TKOFF_ALT",
        "WP_LOITER_RAD",
    }
)
"""Parameters that winged vehicles need for moving; their values are kept after each read or write."""
_AIRBORNE = 0.5  # m above home; used if the autopilot does not report whether it flies


class BatteryReading(msgspec.Struct, frozen=True):
    """Main battery: percent 0 to 100, volts, amperes, remaining s; None if unknown."""

    percent: float | None = None
    voltage: float | None = None
    current: float | None = None
    charging: bool | None = None
    seconds_left: float | None = None


class Fix(msgspec.Struct, frozen=True):
    """Fix of the satellite receiver; accuracies in metres."""

    point: GeoPoint
    kind: str
    satellites: int | None
    horizontal_accuracy: float | None
    vertical_accuracy: float | None


class Angles(msgspec.Struct, frozen=True):
    """Attitude, FRD in NED, radians."""

    roll: float
    pitch: float
    yaw: float


class VehicleState(msgspec.Struct, frozen=True):
    """Latest values; times are monotonic seconds of arrival, None before the first."""

    heartbeat: Heartbeat | None = None
    heartbeat_at: float = -math.inf
    beats: int = 0  # heartbeats since the last silence
    boot_ms: int | None = None
    reboots: int = 0
    landed: Landed = Landed.UNDEFINED
    vtol_state: int | None = None  # MAV_VTOL_STATE, 0 if not a VTOL; None: not reported since the last loss
    position: GeoPoint | None = None  # altitude AMSL
    position_at: float = -math.inf
    relative_altitude: float | None = None  # m above home, as reported
    velocity: Vector3 | None = None  # NED, m/s
    heading: float | None = None  # degrees clockwise from north
    attitude: Angles | None = None
    attitude_at: float = -math.inf
    battery: BatteryReading = BatteryReading()
    battery_has_own_message: bool = False
    fix: Fix | None = None
    fix_at: float = -math.inf  # last message of the receiver, with or without a fix
    had_fix: bool = False  # since it started
    satellites: int | None = None
    home: GeoPoint | None = None
    prearm_ok: bool | None = None
    remote_control: bool | None = None  # reception of a pilot's; None: no receiver
    estimator_flags: int | None = None
    had_estimate: bool = False  # of the position, since the start
    mission_current: int | None = None
    mission_total: int | None = None
    mission_reached: int | None = None
    sensors: OnboardSensors = OnboardSensors()
    settings: Mapping[str, float] = {}  # reported parameters of ``SETTINGS``
    remote_id: OpenDroneIdArmStatus | None = None
    remote_id_at: float = -math.inf

    @property
    def armed(self) -> bool:
        """True while the motors may turn."""
        return self.heartbeat is not None and bool(self.heartbeat.base_mode & ARMED_FLAG)

    @property
    def failsafe(self) -> bool:
        """True while the autopilot is in a fail-safe."""
        return self.heartbeat is not None and self.heartbeat.system_status >= Status.CRITICAL

    @property
    def in_air(self) -> bool | None:
        """Whether the vehicle flies; None if unknown, and for a vehicle on the surface."""
        if self.on_the_surface:
            return None
        if self.landed is not _UNDEFINED:
            return self.landed is not _ON_GROUND
        if self.heartbeat is not None and not self.armed:
            return False
        if self.relative_altitude is not None and self.relative_altitude > _AIRBORNE:
            return True
        return None

    @property
    def on_the_surface(self) -> bool:
        """True for a vehicle on ground or water: its height above home is meaningless.

        ArduRover sets its home's altitude before its receiver has one, and then reports 488 m at sea level.
        """
        return self.heartbeat is not None and self.heartbeat.type in ON_THE_SURFACE

    @property
    def estimator_has_position(self) -> bool | None:
        """Whether the estimator's flags confirm its position, None without flags.

        The flag for a constant position is not used: PX4 sets it at rest, ArduPilot only without this one.
        """
        flags = self.estimator_flags
        return None if flags is None else bool(flags & _ABSOLUTE_POSITION)

    @property
    def home_altitude(self) -> float | None:
        """Altitude of home, m AMSL, None while home is unknown; more recent than HOME_POSITION itself."""
        if self.home is None or self.position is None or self.relative_altitude is None:
            return None
        return self.position.altitude - self.relative_altitude

    @property
    def speed(self) -> float:
        """Speed over all axes in m/s, infinite while unknown."""
        return self.velocity.norm() if self.velocity is not None else math.inf

    def connected(self, now: float) -> bool:
        """Return True while heartbeats arrive: lost after 3 s, back with the second one."""
        return now - self.heartbeat_at <= SILENCE and self.beats >= _BEATS_TO_RETURN

    def knows_where(self, now: float) -> bool:
        """Return True while position and attitude are recent, and confirmed by the estimator's flags.

        Without satellites both autopilots keep reporting a position, which drifts by hundreds of metres.
        """
        fresh = now - self.position_at <= _FRESH and now - self.attitude_at <= _FRESH
        return fresh and self.estimator_has_position is not False

    def fix_reported(self, now: float) -> bool:
        """Return True if the satellite receiver sends messages, or had a fix since the start."""
        return self.had_fix or now - self.fix_at <= _FIX_FRESH

    def fix_now(self, now: float) -> Fix | None:
        """Return the fix; None without one, or when the receiver is silent."""
        return self.fix if now - self.fix_at <= _FIX_FRESH else None


def reduce(state: VehicleState, message: MavlinkMessage, now: float) -> VehicleState:
    """Return the state after ``message``, which arrived at monotonic ``now``."""
    kind = type(message)
    changes: dict[str, object] = {}
    boot_ms: int | None = getattr(message, "time_boot_ms", None)
    if boot_ms is not None:
        if _has_rebooted(state.boot_ms, boot_ms):
            state = _rebooted(state, boot_ms)
        changes["boot_ms"] = boot_ms
    if kind in CARRIED:
        changes["sensors"] = reduce_sensors(state.sensors, message, now)
    elif change := _CHANGES.get(kind):
        changes |= change(state, message, now)
    return msgspec.structs.replace(state, **changes) if changes else state


def _has_rebooted(before: int | None, boot_ms: int) -> bool:
    """Return True if the vehicle's own clock shows a restart."""
    return before is not None and boot_ms + _BACKWARDS < before < _CLOCK_WRAP


def _rebooted(state: VehicleState, boot_ms: int | None) -> VehicleState:
    """Return the state that remains valid after a restart."""
    return VehicleState(
        heartbeat=state.heartbeat,
        heartbeat_at=state.heartbeat_at,
        beats=state.beats,
        boot_ms=boot_ms,
        reboots=state.reboots + 1,
    )


def _heartbeat(state: VehicleState, message: Heartbeat, now: float) -> dict[str, object]:
    """Count heartbeats; a booting vehicle that was up before has restarted."""
    beats = state.beats + 1 if now - state.heartbeat_at <= SILENCE else 1
    if state.heartbeat is None:
        beats = _BEATS_TO_RETURN  # the first contact counts at once; only a return needs a second heartbeat
    changes: dict[str, object] = {"heartbeat": message, "heartbeat_at": now, "beats": beats}
    if now - state.heartbeat_at > SILENCE:
        changes["vtol_state"] = None  # its flight state may have changed by now
    was_up = state.heartbeat is not None and state.heartbeat.system_status > Status.CALIBRATING
    # PX4 reports UNINIT also while it is up and cannot arm; ArduPilot reports BOOT at boot only.
    if was_up and message.system_status == Status.BOOT:
        changes |= msgspec.structs.asdict(_rebooted(state, None)) | changes
    return changes


def _sys_status(state: VehicleState, message: SysStatus, _now: float) -> dict[str, object]:
    """Apply the arming check, the remote control, and the battery unless it has its own message."""
    healthy = message.onboard_control_sensors_health
    receives = bool(message.onboard_control_sensors_present & RC_RECEIVER)
    changes: dict[str, object] = {
        "prearm_ok": bool(healthy & PREARM_OK),
        "remote_control": bool(healthy & RC_RECEIVER) if receives else None,
    }
    if not state.battery_has_own_message:
        millivolts = message.voltage_battery
        changes["battery"] = BatteryReading(
            percent=_percent(message.battery_remaining),
            voltage=None if millivolts in {0, _UNKNOWN_16} else millivolts / 1000,
            current=_amperes(message.current_battery),
        )
    return changes


def _battery_status(_state: VehicleState, message: BatteryStatus, _now: float) -> dict[str, object]:
    """Apply the first battery."""
    if message.id != 0:
        return {}
    cells = [cell for cell in message.voltages if cell not in {0, _UNKNOWN_16}]
    battery = BatteryReading(
        percent=_percent(message.battery_remaining),
        voltage=sum(cells) / 1000 if cells else None,
        current=_amperes(message.current_battery),
        charging=message.charge_state == _CHARGING if message.charge_state else None,
        seconds_left=float(message.time_remaining) if message.time_remaining > 0 else None,
    )
    return {"battery": battery, "battery_has_own_message": True}


def _percent(remaining: int) -> float | None:
    """Return a charge, None if unknown or invalid."""
    return float(remaining) if 0 <= remaining <= 100 else None


def _amperes(centiamperes: int) -> float | None:
    """Return a current, None if unknown."""
    return centiamperes / 100 if centiamperes >= 0 else None


def _gps(_state: VehicleState, message: GpsRawInt, now: float) -> dict[str, object]:
    """Apply a 2D or 3D fix; drop it when lost, because PX4 keeps reporting its last position."""
    kind = FIX_TYPES.get(message.fix_type)
    satellites = None if message.satellites_visible == 255 else message.satellites_visible
    if kind is None or not _is_place(message.lat, message.lon):
        return {"fix": None, "fix_at": now, "satellites": satellites}
    fix = Fix(
        point=GeoPoint(message.lat / 1e7, message.lon / 1e7, message.alt / 1000),
        kind=kind,
        satellites=satellites,
        horizontal_accuracy=message.h_acc / 1000 or None,
        vertical_accuracy=message.v_acc / 1000 or None,
    )
    return {"fix": fix, "fix_at": now, "had_fix": True, "satellites": satellites}


def _estimator(
    state: VehicleState, message: EkfStatusReport | EstimatorStatus, _now: float
) -> dict[str, object]:
    """Apply the estimator's flags."""
    had = state.had_estimate or bool(message.flags & _ABSOLUTE_POSITION)
    return {"estimator_flags": message.flags, "had_estimate": had}


def _is_place(latitude: int, longitude: int) -> bool:
    """Return True for a valid position, degrees times 1e7; autopilots send 0/0 for an unknown one."""
    return (
        (latitude, longitude) != (0, 0) and abs(latitude) <= 900_000_000 and abs(longitude) <= 1_800_000_000
    )


def _attitude(_state: VehicleState, message: Attitude, now: float) -> dict[str, object]:
    """Apply an attitude, if it is finite."""
    if not all(map(math.isfinite, (message.roll, message.pitch, message.yaw))):
        return {}
    return {"attitude": Angles(message.roll, message.pitch, message.yaw), "attitude_at": now}


def _position(_state: VehicleState, message: GlobalPositionInt, now: float) -> dict[str, object]:
    """Apply a position, unless the estimator has none yet."""
    if not _is_place(message.lat, message.lon):
        return {}
    return {
        "position": GeoPoint(message.lat / 1e7, message.lon / 1e7, message.alt / 1000),
        "position_at": now,
        "relative_altitude": message.relative_alt / 1000,
        "velocity": Vector3(message.vx / 100, message.vy / 100, message.vz / 100),
        "heading": None if message.hdg == _UNKNOWN_16 else message.hdg / 100,
    }


def _home(_state: VehicleState, message: HomePosition, _now: float) -> dict[str, object]:
    """Apply the home position."""
    if not _is_place(message.latitude, message.longitude):
        return {}
    return {"home": GeoPoint(message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1000)}


def _landed(_state: VehicleState, message: ExtendedSysState, _now: float) -> dict[str, object]:
    """Apply the landed state, and the VTOL state."""
    landed = _LANDED.get(message.landed_state, _UNDEFINED)
    return {"landed": landed, "vtol_state": message.vtol_state}


def _mission(_state: VehicleState, message: MissionCurrent, _now: float) -> dict[str, object]:
    """Apply the active item of the stored mission; 0 and 65535 items mean that there is none."""
    total = message.total if message.total not in {0, _UNKNOWN_16} else None
    return {"mission_current": message.seq, "mission_total": total}


def _setting(state: VehicleState, message: ParamValue, _now: float) -> dict[str, object]:
    """Apply a parameter in ``SETTINGS``; none of them is an integer on PX4."""
    if message.param_id not in SETTINGS:
        return {}
    (value,) = struct.unpack("<f", struct.pack("<I", message.param_value))
    return {"settings": {**state.settings, message.param_id: value}} if math.isfinite(value) else {}


_CHANGES: Mapping[type[MavlinkMessage], Callable[[VehicleState, Any, float], dict[str, object]]] = {
    Attitude: _attitude,
    BatteryStatus: _battery_status,
    EkfStatusReport: _estimator,
    EstimatorStatus: _estimator,
    ExtendedSysState: _landed,
    GlobalPositionInt: _position,
    GpsRawInt: _gps,
    Heartbeat: _heartbeat,
    HomePosition: _home,
    MissionCurrent: _mission,
    ParamValue: _setting,
    OpenDroneIdArmStatus: lambda _state, message, now: {"remote_id": message, "remote_id_at": now},
    MissionItemReached: lambda _state, message, _now: {"mission_reached": message.seq},
    SysStatus: _sys_status,
    SystemTime: lambda _state, _message, _now: {},
}
