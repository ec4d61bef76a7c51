"""Numbers of the MAVLink specification used in this adapter, by name."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping

NAN = math.nan
AUTOPILOT = 1  # component id of the flight controller
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: stations, cameras, gimbals
CAMERAS = range(100, 106)  # component ids
CAMERA_TYPE = 30  # MAV_TYPE
ARMED_FLAG = 0x80  # in the heartbeat's base_mode
CUSTOM_MODE = 1.0  # param1 of DO_SET_MODE: an autopilot-specific mode
FORCE = 21196.0  # param2 of ARM_DISARM: skip the checks
PREARM_OK = 0x1000_0000  # in the sensor health of SYS_STATUS
RC_RECEIVER = 0x1_0000  # likewise, and in the sensors present


class Cmd(enum.IntEnum):
    """MAV_CMD."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    NAV_VTOL_LAND = 85
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_LAND_START = 189
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_SET_REVERSE = 194
    DO_SET_MISSION_CURRENT = 224
    PREFLIGHT_CALIBRATION = 241
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    DO_VTOL_TRANSITION = 3000
    DO_START_MAG_CAL = 42424
    DO_CANCEL_MAG_CAL = 42426
    NAV_FENCE_POLYGON_VERTEX_INCLUSION = 5001
    NAV_FENCE_POLYGON_VERTEX_EXCLUSION = 5002


class Result(enum.IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    CANCELLED = 6
    COMMAND_LONG_ONLY = 7
    COMMAND_INT_ONLY = 8
    COMMAND_UNSUPPORTED_MAV_FRAME = 9


class Frame(enum.IntEnum):
    """MAV_FRAME."""

    GLOBAL = 0
    LOCAL_NED = 1
    MISSION = 2
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    LOCAL_OFFSET_NED = 7
    BODY_NED = 8


class Landed(enum.IntEnum):
    """MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Status(enum.IntEnum):
    """MAV_STATE."""

    UNINIT = 0
    BOOT = 1
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    EMERGENCY = 6
    POWEROFF = 7
    FLIGHT_TERMINATION = 8


MAG_CAL_SUCCESS = 4  # MAG_CAL_STATUS
FIX_TYPES: Mapping[int, str] = {
    2: "2d",
    3: "3d",
    4: "dgps",
    5: "rtk_float",
    6: "rtk_fixed",
    7: "static",
    8: "ppp",
}
ARDUPILOT, PX4 = 3, 12  # MAV_AUTOPILOT
MULTIROTORS = (2, 3, 4, 13, 14, 15, 29, 35)  # MAV_TYPE: multirotors
VTOLS = range(19, 26)  # MAV_TYPE
ROVERS = frozenset({10, 11})  # MAV_TYPE: rovers and boats
ON_THE_SURFACE = frozenset({5, *ROVERS})  # MAV_TYPE: vehicles without a meaningful height above home
VTOL_GOES_FORWARD = 1  # MAV_VTOL_STATE: in transition to its wings
VTOL_HOVERS = frozenset({2, 3})  # MAV_VTOL_STATE: in hover, or in transition to it
VEHICLE_TYPES: Mapping[int, str] = {
    0: "generic",
    1: "fixed_wing",
    2: "quadrotor",
    3: "coaxial",
    4: "helicopter",
    5: "antenna_tracker",
    7: "airship",
    8: "free_balloon",
    9: "rocket",
    10: "ground_rover",
    11: "surface_boat",
    12: "submarine",
    13: "hexarotor",
    14: "octorotor",
    15: "tricopter",
    16: "flapping_wing",
    17: "kite",
    19: "vtol_tailsitter_duorotor",
    20: "vtol_tailsitter_quadrotor",
    21: "vtol_tiltrotor",
    22: "vtol_fixedrotor",
    23: "vtol_tailsitter",
    24: "vtol_tiltwing",
    25: "vtol",
    28: "parafoil",
    29: "dodecarotor",
    35: "decarotor",
    37: "parachute",
}


def type_name(type_number: int) -> str:
    """Return the name of a MAV_TYPE, or its number."""
    return VEHICLE_TYPES.get(type_number, f"vehicle of type {type_number}")


def result_name(result: int) -> str:
    """Return the name of a MAV_RESULT, or its number."""
    return Result(result).name if result in set(Result) else f"result {result}"
