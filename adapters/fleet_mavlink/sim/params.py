"""Parameters of the simulated autopilots, and the parameter protocol.

ArduPilot sends every number as a float; PX4 puts the bits of an int32 there. Neither answers for an unknown
name.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from typing import Any, Literal

from pymavlink.dialects.v20 import all as mav

INT32 = int(mav.MAV_PARAM_TYPE_INT32)
REAL32 = int(mav.MAV_PARAM_TYPE_REAL32)
INT16 = int(mav.MAV_PARAM_TYPE_INT16)
INT8 = int(mav.MAV_PARAM_TYPE_INT8)

Encoding = Literal["cast", "bytewise"]
ParameterValues = dict[str, tuple[int, float]]  # name -> (MAV_PARAM_TYPE, value)
_LIST_PACE = 20  # values sent per step of the vehicle


def ardupilot_params(system_id: int) -> ParameterValues:
    """Return the parameters used here, with ArduCopter's defaults."""
    return {
        "ARMING_CHECK": (INT32, 1),
        "BATT_CRT_VOLT": (REAL32, 0.0),
        "BATT_FS_CRT_ACT": (INT8, 0),
        "BATT_FS_LOW_ACT": (INT8, 0),
        "BATT_LOW_TIMER": (INT8, 10),
        "BATT_LOW_VOLT": (REAL32, 10.5),
        "DISARM_DELAY": (INT8, 10),
        "FENCE_ACTION": (INT8, 1),
        "FENCE_ALT_MAX": (REAL32, 100.0),
        "FENCE_ENABLE": (INT8, 0),
        "FENCE_OPTIONS": (INT16, 1),
        "FENCE_RADIUS": (REAL32, 300.0),
        "FENCE_TYPE": (INT8, 7),
        "FORMAT_VERSION": (INT16, 120),
        "FRAME_CLASS": (INT8, 1),
        "FS_EKF_ACTION": (INT8, 1),
        "FS_GCS_ENABLE": (INT8, 0),
        "FS_GCS_TIMEOUT": (REAL32, 5.0),
        "FS_OPTIONS": (INT32, 16),
        "FS_THR_ENABLE": (INT8, 1),
        "GUID_OPTIONS": (INT32, 0),
        "GUID_TIMEOUT": (REAL32, 3.0),
        "LAND_SPEED": (INT16, 50),
        "PILOT_SPEED_DN": (INT16, 0),
        "RTL_ALT": (INT32, 1500),
        "RTL_LOIT_TIME": (INT32, 5000),
        "SIM_BATT_VOLTAGE": (REAL32, 12.6),
        "SIM_GPS_DISABLE": (INT8, 0),
        "SIM_WIND_SPD": (REAL32, 0.0),
        "SYSID_ENFORCE": (INT8, 0),
        "SYSID_MYGCS": (INT16, 255),
        "SYSID_THISMAV": (INT16, system_id),
        "WPNAV_ACCEL": (REAL32, 250.0),
        "WPNAV_SPEED": (REAL32, 1000.0),
        "WPNAV_SPEED_DN": (REAL32, 150.0),
        "WPNAV_SPEED_UP": (REAL32, 250.0),
        "WP_YAW_BEHAVIOR": (INT8, 2),
    }


def rover_params(system_id: int) -> ParameterValues:
    """Return the parameters used here, with ArduRover's defaults."""
    return ardupilot_params(system_id) | {
        "FENCE_TYPE": (INT8, 6),
        "FS_ACTION": (INT8, 2),
        "FS_TIMEOUT": (REAL32, 1.5),
        "SERVO1_FUNCTION": (INT16, 26),
        "SERVO2_FUNCTION": (INT16, 0),
        "SERVO3_FUNCTION": (INT16, 70),
        "SERVO4_FUNCTION": (INT16, 0),
        "WP_RADIUS": (REAL32, 2.0),
        "WP_SPEED": (REAL32, 5.0),
    }


def plane_params(system_id: int) -> ParameterValues:
    """Return the parameters used here, with ArduPlane's defaults."""
    return ardupilot_params(system_id) | {
        "MIN_GROUNDSPEED": (REAL32, 0.0),
        "AIRSPEED_CRUISE": (REAL32, 22.0),
        "AIRSPEED_MAX": (INT16, 30),
        "AIRSPEED_MIN": (INT16, 10),
        "FS_GCS_ENABL": (INT8, 0),
        "FS_LONG_ACTN": (INT8, 0),
        "FS_LONG_TIMEOUT": (REAL32, 5.0),
        "RTL_ALTITUDE": (REAL32, 100.0),
        "RTL_AUTOLAND": (INT8, 0),
        "TECS_CLMB_MAX": (REAL32, 5.0),
        "TECS_SINK_MIN": (REAL32, 2.0),
        "THR_FAILSAFE": (INT8, 1),
        "TKOFF_ALT": (REAL32, 50.0),
        "WP_LOITER_RAD": (INT16, 80),
        "WP_RADIUS": (INT16, 90),
    }


def quadplane_params(system_id: int) -> ParameterValues:
    """Return the parameters used here, with a QuadPlane's defaults."""
    return plane_params(system_id) | {
        "Q_ASSIST_SPEED": (REAL32, 7.0),
        "Q_ENABLE": (INT8, 1),
        "Q_GUIDED_MODE": (INT8, 0),
        "Q_TRANS_DECEL": (REAL32, 2.0),
        "Q_WP_SPEED": (REAL32, 500.0),
    }


def px4_plane_params(system_id: int) -> ParameterValues:
    """Return the parameters used here, with the defaults of PX4's simulated plane."""
    return px4_params(system_id) | {
        "FW_AIRSPD_MAX": (REAL32, 20.0),
        "FW_AIRSPD_MIN": (REAL32, 10.0),
        "FW_AIRSPD_TRIM": (REAL32, 15.0),
        "FW_T_CLMB_R_SP": (REAL32, 3.0),
        "FW_T_SINK_R_SP": (REAL32, 2.0),
        "MIS_TAKEOFF_ALT": (REAL32, 25.0),
        "MIS_TKO_LAND_REQ": (INT32, 2),
        "NAV_LOITER_RAD": (REAL32, 80.0),
        "RTL_RETURN_ALT": (REAL32, 100.0),
        "SYS_AUTOSTART": (INT32, 10041),
    }


def px4_params(system_id: int) -> ParameterValues:
    """Return the parameters used here, with PX4's defaults."""
    return {
        "BAT_CRIT_THR": (REAL32, 0.07),
        "BAT_EMERGEN_THR": (REAL32, 0.05),
        "BAT_LOW_THR": (REAL32, 0.15),
        "COM_DISARM_LAND": (REAL32, 2.0),
        "COM_DISARM_PRFLT": (REAL32, 10.0),
        "COM_DL_LOSS_T": (INT32, 10),
        "COM_FAIL_ACT_T": (REAL32, 5.0),
        "COM_LOW_BAT_ACT": (INT32, 3),
        "COM_OBL_RC_ACT": (INT32, 0),
        "COM_OF_LOSS_T": (REAL32, 1.0),
        "COM_RCL_EXCEPT": (INT32, 0),
        "COM_RC_IN_MODE": (INT32, 1),
        "COM_RC_LOSS_T": (REAL32, 0.5),
        "GF_ACTION": (INT32, 2),
        "GF_MAX_HOR_DIST": (REAL32, 0.0),
        "GF_MAX_VER_DIST": (REAL32, 0.0),
        "MAV_SYS_ID": (INT32, system_id),
        "MIS_TAKEOFF_ALT": (REAL32, 2.5),
        "MPC_LAND_ALT1": (REAL32, 10.0),
        "MPC_LAND_SPEED": (REAL32, 0.7),
        "MPC_TKO_SPEED": (REAL32, 1.5),
        "MPC_XY_CRUISE": (REAL32, 5.0),
        "MPC_XY_VEL_MAX": (REAL32, 12.0),
        "MPC_YAW_MODE": (INT32, 0),
        "MPC_Z_VEL_MAX_DN": (REAL32, 1.5),
        "MPC_Z_VEL_MAX_UP": (REAL32, 3.0),
        "NAV_DLL_ACT": (INT32, 0),
        "NAV_MC_ALT_RAD": (REAL32, 0.8),
        "NAV_RCL_ACT": (INT32, 2),
        "RTL_RETURN_ALT": (REAL32, 30.0),
        "SIM_BAT_DRAIN": (REAL32, 600.0),
        "SIM_BAT_MIN_PCT": (REAL32, 50.0),
        "SIM_GPS_USED": (INT32, 10),
        "SYS_AUTOSTART": (INT32, 10040),
        "SYS_HAS_GPS": (INT32, 1),
    }


def encode(kind: int, value: float, encoding: Encoding) -> float:
    """Return the float that carries ``value`` on the wire."""
    if encoding == "cast" or kind == REAL32:
        return float(value)
    (sensors,) = struct.unpack("<f", struct.pack("<i", int(value)))
    return float(sensors)


def decode(kind: int, sensors: float, encoding: Encoding) -> float | None:
    """Return the value in a float from the wire, None for NaN and infinity."""
    if encoding == "bytewise" and kind != REAL32:
        (number,) = struct.unpack("<i", struct.pack("<f", sensors))
        return float(number)
    if not math.isfinite(sensors):
        return None
    return float(sensors) if kind == REAL32 else float(int(sensors))


class Params:
    """Parameters of one vehicle (they survive a reboot) and the answers to the PARAM messages."""

    def __init__(self, values: ParameterValues, encoding: Encoding) -> None:
        self._values = values
        self._encoding = encoding
        self._queue: list[str] = []

    def __getitem__(self, name: str) -> float:
        return self._values[name][1]

    def __setitem__(self, name: str, value: float) -> None:
        self._values[name] = (self._values[name][0], value)

    def reboot(self) -> None:
        """End the transfer of a list."""
        self._queue.clear()

    def pending(self) -> list[object]:
        """Return the next PARAM_VALUE messages of a requested list."""
        batch, self._queue = self._queue[:_LIST_PACE], self._queue[_LIST_PACE:]
        return [self._message(name) for name in batch]

    def requested_list(self) -> Iterable[object]:
        """Begin to send all parameters; PX4 adds its hash at the end."""
        self._queue = sorted(self._values)
        if self._encoding == "bytewise":
            self._queue.append("_HASH_CHECK")
        return ()

    def requested_read(self, message: Any) -> Iterable[object]:
        """Answer PARAM_REQUEST_READ by name, or by index if it is not negative."""
        names = sorted(self._values)
        name = message.param_id
        if message.param_index >= 0:
            name = names[message.param_index] if message.param_index < len(names) else ""
        return [self._message(name)] if name in self._values or name == "_HASH_CHECK" else ()

    def requested_set(self, message: Any) -> Iterable[object]:
        """Store the value of a PARAM_SET and answer with the stored one; the range is not checked."""
        name = message.param_id
        if name not in self._values:
            return ()
        kind = self._values[name][0]
        value = decode(kind, message.param_value, self._encoding)
        if value is not None:
            self._values[name] = (kind, value)
        return [self._message(name)]

    def _message(self, name: str) -> object:
        """Return PARAM_VALUE for a name."""
        if name == "_HASH_CHECK":
            sensors = encode(INT32, len(self._values) * 7919, "bytewise")
            return mav.MAVLink_param_value_message(b"_HASH_CHECK", sensors, 6, len(self._values), 65535)
        kind, value = self._values[name]
        return mav.MAVLink_param_value_message(
            name.encode(),
            encode(kind, value, self._encoding),
            kind,
            len(self._values),
            sorted(self._values).index(name),
        )
