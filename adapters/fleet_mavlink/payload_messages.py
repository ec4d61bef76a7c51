"""MAVLink messages of the payload: inertial sensors, motors, compass, gimbal, camera, signing key."""

from __future__ import annotations

from typing import ClassVar

from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink.messages import MavlinkMessage


class RawImu(MavlinkMessage, frozen=True):
    """RAW_IMU in ArduPilot's units: FRD, thousandths of g and thousandths of rad/s."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_RAW_IMU
    xacc: int
    yacc: int
    zacc: int
    xgyro: int
    ygyro: int
    zgyro: int


class HighresImu(MavlinkMessage, frozen=True):
    """HIGHRES_IMU: FRD, m/s2 and rad/s; ``fields_updated`` has a bit for each of them."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_HIGHRES_IMU
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    fields_updated: int


class MagCalProgress(MavlinkMessage, frozen=True):
    """MAG_CAL_PROGRESS: progress of one compass, percent."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MAG_CAL_PROGRESS
    compass_id: int
    cal_mask: int
    completion_pct: int


class MagCalReport(MavlinkMessage, frozen=True):
    """MAG_CAL_REPORT: result of one compass (MAG_CAL_STATUS)."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MAG_CAL_REPORT
    compass_id: int
    cal_mask: int
    cal_status: int
    autosaved: int
    fitness: float


class SetupSigning(MavlinkMessage, frozen=True):
    """SETUP_SIGNING: the key for signing from now on; never acknowledged."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SETUP_SIGNING
    target_system: int
    target_component: int
    secret_key: tuple[int, ...]
    initial_timestamp: int  # 10 us since 2015


class CameraImageCaptured(MavlinkMessage, frozen=True):
    """CAMERA_IMAGE_CAPTURED: a picture was taken (``capture_result`` 1), or it failed."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
    image_index: int
    capture_result: int
    file_url: str


class GimbalManagerInformation(MavlinkMessage, frozen=True):
    """GIMBAL_MANAGER_INFORMATION: presence of a gimbal, and its limits in radians."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION
    gimbal_device_id: int
    pitch_min: float
    pitch_max: float
    yaw_min: float
    yaw_max: float


class GimbalDeviceAttitudeStatus(MavlinkMessage, frozen=True):
    """GIMBAL_DEVICE_ATTITUDE_STATUS: attitude of the gimbal; w x y z, FRD."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS
    flags: int
    q: tuple[float, ...]


class EscTelemetry1To4(MavlinkMessage, frozen=True):
    """ESC_TELEMETRY_1_TO_4 (ArduPilot): revolutions per minute of four motors."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4
    rpm: tuple[int, ...]


INCOMING: tuple[type[MavlinkMessage], ...] = (
    CameraImageCaptured,
    EscTelemetry1To4,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    HighresImu,
    MagCalProgress,
    MagCalReport,
    RawImu,
)
OUTGOING: tuple[type[MavlinkMessage], ...] = (SetupSigning,)
