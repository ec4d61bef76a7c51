"""Numbers of the MAVLink specification used in this adapter, by name, taken from pymavlink's dialect."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import all as dialect

NAN = math.nan
AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1  # component id of the flight controller
NO_AUTOPILOT = dialect.MAV_AUTOPILOT_INVALID  # stations, cameras, gimbals
CAMERAS = range(dialect.MAV_COMP_ID_CAMERA, dialect.MAV_COMP_ID_CAMERA6 + 1)
CAMERA_TYPE = dialect.MAV_TYPE_CAMERA
ARMED_FLAG = dialect.MAV_MODE_FLAG_SAFETY_ARMED  # in the heartbeat's base_mode
CUSTOM_MODE = 1.0  # param1 of DO_SET_MODE: an autopilot-specific mode
FORCE = 21196.0  # param2 of ARM_DISARM: skip the checks
PREARM_OK = dialect.MAV_SYS_STATUS_PREARM_CHECK  # in the sensor health of SYS_STATUS
RC_RECEIVER = dialect.MAV_SYS_STATUS_SENSOR_RC_RECEIVER  # likewise, and in the sensors present


class MavCmd(enum.IntEnum):
    """MAV_CMD."""

    NAV_WAYPOINT = dialect.MAV_CMD_NAV_WAYPOINT
    NAV_LOITER_UNLIM = dialect.MAV_CMD_NAV_LOITER_UNLIM
    NAV_LOITER_TURNS = dialect.MAV_CMD_NAV_LOITER_TURNS
    NAV_LOITER_TIME = dialect.MAV_CMD_NAV_LOITER_TIME
    NAV_RETURN_TO_LAUNCH = dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
    NAV_LAND = dialect.MAV_CMD_NAV_LAND
    NAV_TAKEOFF = dialect.MAV_CMD_NAV_TAKEOFF
    NAV_LOITER_TO_ALT = dialect.MAV_CMD_NAV_LOITER_TO_ALT
    NAV_VTOL_LAND = dialect.MAV_CMD_NAV_VTOL_LAND
    CONDITION_YAW = dialect.MAV_CMD_CONDITION_YAW
    DO_SET_MODE = dialect.MAV_CMD_DO_SET_MODE
    DO_CHANGE_SPEED = dialect.MAV_CMD_DO_CHANGE_SPEED
    DO_SET_HOME = dialect.MAV_CMD_DO_SET_HOME
    DO_LAND_START = dialect.MAV_CMD_DO_LAND_START
    DO_REPOSITION = dialect.MAV_CMD_DO_REPOSITION
    DO_PAUSE_CONTINUE = dialect.MAV_CMD_DO_PAUSE_CONTINUE
    DO_SET_REVERSE = dialect.MAV_CMD_DO_SET_REVERSE
    DO_SET_MISSION_CURRENT = dialect.MAV_CMD_DO_SET_MISSION_CURRENT
    PREFLIGHT_CALIBRATION = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
    PREFLIGHT_REBOOT_SHUTDOWN = dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    MISSION_START = dialect.MAV_CMD_MISSION_START
    COMPONENT_ARM_DISARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
    RUN_PREARM_CHECKS = dialect.MAV_CMD_RUN_PREARM_CHECKS
    SET_MESSAGE_INTERVAL = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
    REQUEST_MESSAGE = dialect.MAV_CMD_REQUEST_MESSAGE
    DO_GIMBAL_MANAGER_PITCHYAW = dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
    DO_GIMBAL_MANAGER_CONFIGURE = dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
    IMAGE_START_CAPTURE = dialect.MAV_CMD_IMAGE_START_CAPTURE
    DO_VTOL_TRANSITION = dialect.MAV_CMD_DO_VTOL_TRANSITION
    DO_START_MAG_CAL = dialect.MAV_CMD_DO_START_MAG_CAL
    DO_CANCEL_MAG_CAL = dialect.MAV_CMD_DO_CANCEL_MAG_CAL
    NAV_FENCE_POLYGON_VERTEX_INCLUSION = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    NAV_FENCE_POLYGON_VERTEX_EXCLUSION = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION


class MavResult(enum.IntEnum):
    """MAV_RESULT."""

    ACCEPTED = dialect.MAV_RESULT_ACCEPTED
    TEMPORARILY_REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    DENIED = dialect.MAV_RESULT_DENIED
    UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED
    FAILED = dialect.MAV_RESULT_FAILED
    IN_PROGRESS = dialect.MAV_RESULT_IN_PROGRESS
    CANCELLED = 6  # not in pymavlink yet
    COMMAND_LONG_ONLY = dialect.MAV_RESULT_COMMAND_LONG_ONLY
    COMMAND_INT_ONLY = dialect.MAV_RESULT_COMMAND_INT_ONLY
    COMMAND_UNSUPPORTED_MAV_FRAME = 9  # not in pymavlink yet


class MavFrame(enum.IntEnum):
    """MAV_FRAME."""

    GLOBAL = dialect.MAV_FRAME_GLOBAL
    LOCAL_NED = dialect.MAV_FRAME_LOCAL_NED
    MISSION = dialect.MAV_FRAME_MISSION
    GLOBAL_INT = dialect.MAV_FRAME_GLOBAL_INT
    GLOBAL_RELATIVE_ALT_INT = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    LOCAL_OFFSET_NED = dialect.MAV_FRAME_LOCAL_OFFSET_NED
    BODY_NED = dialect.MAV_FRAME_BODY_NED


class Landed(enum.IntEnum):
    """MAV_LANDED_STATE."""

    UNDEFINED = dialect.MAV_LANDED_STATE_UNDEFINED
    ON_GROUND = dialect.MAV_LANDED_STATE_ON_GROUND
    IN_AIR = dialect.MAV_LANDED_STATE_IN_AIR
    TAKEOFF = dialect.MAV_LANDED_STATE_TAKEOFF
    LANDING = dialect.MAV_LANDED_STATE_LANDING


class Status(enum.IntEnum):
    """MAV_STATE."""

    UNINIT = dialect.MAV_STATE_UNINIT
    BOOT = dialect.MAV_STATE_BOOT
    CALIBRATING = dialect.MAV_STATE_CALIBRATING
    STANDBY = dialect.MAV_STATE_STANDBY
    ACTIVE = dialect.MAV_STATE_ACTIVE
    CRITICAL = dialect.MAV_STATE_CRITICAL
    EMERGENCY = dialect.MAV_STATE_EMERGENCY
    POWEROFF = dialect.MAV_STATE_POWEROFF
    FLIGHT_TERMINATION = dialect.MAV_STATE_FLIGHT_TERMINATION


MAG_CAL_SUCCESS = dialect.MAG_CAL_SUCCESS
FIX_TYPES: Mapping[int, str] = {
    2: "2d",
    3: "3d",
    4: "dgps",
    5: "rtk_float",
    6: "rtk_fixed",
    7: "static",
    8: "ppp",
}
ARDUPILOT, PX4 = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, dialect.MAV_AUTOPILOT_PX4
MULTIROTORS = (2, 3, 4, 13, 14, 15, 29, 35)  # MAV_TYPE: multirotors
VTOLS = range(19, 26)  # MAV_TYPE
ROVERS = frozenset({dialect.MAV_TYPE_GROUND_ROVER, dialect.MAV_TYPE_SURFACE_BOAT})
ON_THE_SURFACE = frozenset({5, *ROVERS})  # MAV_TYPE: vehicles without a meaningful height above home
VTOL_GOES_FORWARD = dialect.MAV_VTOL_STATE_TRANSITION_TO_FW
VTOL_HOVERS = frozenset({dialect.MAV_VTOL_STATE_TRANSITION_TO_MC, dialect.MAV_VTOL_STATE_MC})
# pymavlink still has placeholders for VTOL types that the specification has since named.
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
    return MavResult(result).name if result in set(MavResult) else f"result {result}"


def mode_names(enumeration: str, own: Mapping[int, str] = MappingProxyType({})) -> Mapping[int, str]:
    """Return the modes of an ArduPilot vehicle by number; ``own`` overrides the dialect's names."""
    names = {
        int(number): entry.name.removeprefix(f"{enumeration}_")
        for number, entry in dialect.enums[enumeration].items()
        if not entry.name.endswith("_ENUM_END")
    }
    return {**names, **own}
