"""MAVLink messages of the payload: inertial sensors, motors, compass, gimbal, camera, signing key."""

from __future__ import annotations

from typing import ClassVar

from fleet_mavlink.messages import MavlinkMessage


class RawImu(MavlinkMessage, frozen=True):
    """RAW_IMU in ArduPilot's units: FRD, thousandths of g and thousandths of rad/s."""

    message_id: ClassVar[int] = 27
    xacc: int
    yacc: int
    zacc: int
    xgyro: int
    ygyro: int
    zgyro: int


class HighresImu(MavlinkMessage, frozen=True):
    """HIGHRES_IMU: FRD, m/s2 and rad/s; ``fields_updated`` has a bit for each of them."""

    message_id: ClassVar[int] = 105
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    fields_updated: int


class MagCalProgress(MavlinkMessage, frozen=True):
    """MAG_CAL_PROGRESS: progress of one compass, percent."""

    message_id: ClassVar[int] = 191
    compass_id: int
    cal_mask: int
    completion_pct: int


class MagCalReport(MavlinkMessage, frozen=True):
    """MAG_CAL_REPORT: result of one compass (MAG_CAL_STATUS)."""

    message_id: ClassVar[int] = 192
    compass_id: int
    cal_mask: int
    cal_status: int
    autosaved: int
    fitness: float


class SetupSigning(MavlinkMessage, frozen=True):
    """SETUP_SIGNING: the key for signing from now on; never acknowledged."""

    message_id: ClassVar[int] = 256
    target_system: int
    target_component: int
    secret_key: tuple[int, ...]
    initial_timestamp: int  # 10 us since 2015


class CameraImageCaptured(MavlinkMessage, frozen=True):
    """CAMERA_IMAGE_CAPTURED: a picture was taken (``capture_result`` 1), or it failed."""

    message_id: ClassVar[int] = 263
    image_index: int
    capture_result: int
    file_url: str


class GimbalManagerInformation(MavlinkMessage, frozen=True):
    """GIMBAL_MANAGER_INFORMATION: presence of a gimbal, and its limits in radians."""

    message_id: ClassVar[int] = 280
    gimbal_device_id: int
    pitch_min: float
    pitch_max: float
    yaw_min: float
    yaw_max: float


class GimbalDeviceAttitudeStatus(MavlinkMessage, frozen=True):
    """GIMBAL_DEVICE_ATTITUDE_STATUS: attitude of the gimbal; w x y z, FRD."""

    message_id: ClassVar[int] = 285
    flags: int
    q: tuple[float, ...]


class EscTelemetry1To4(MavlinkMessage, frozen=True):
    """ESC_TELEMETRY_1_TO_4 (ArduPilot): revolutions per minute of four motors."""

    message_id: ClassVar[int] = 11030
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
