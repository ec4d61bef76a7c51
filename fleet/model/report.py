"""Reports: measured values and states of a robot. Each kind is one channel on the bus.

``stamp`` is the Unix time of the measurement, seconds. An unknown value is None, or the report is not sent:
never a zero in place of an unknown value.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import msgspec

from fleet.model.event import EventReport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState


class PoseReport(msgspec.Struct, frozen=True, gc=False):
    """Position of the robot in the world frame (m, ENU) and its orientation (body FLU to world).

    ``frame_id`` is the name of that frame in the cloud's message; empty: the message has none.
    """

    channel: ClassVar[str] = "position"
    stamp: float
    position: Vector3
    rotation: Quaternion
    frame_id: str = ""


class ScaleReport(msgspec.Struct, frozen=True):
    """Scale at which the twin is drawn, by axis; 1 is the size of the model."""

    channel: ClassVar[str] = "scale"
    stamp: float
    scale: Vector3


class JointTags(msgspec.Struct, frozen=True, omit_defaults=True):
    """Optional fields of a joint report, with the names of ``joint/update``.

    ``source_subtype`` is what moves the joints (a policy, a gamepad), ``workload_uuid`` the run that does.
    ``role``: which of two arms the joints belong to, where one twin has both; sent as ``edge_leader`` or
    ``edge_follower``.
    """

    source_subtype: str | None = None
    workload_uuid: str | None = None
    camera_frame_counters: list[dict[str, Any]] | None = None
    stream_instance_id: str | None = None
    applied_position_targets: dict[str, float] | None = None
    role: Literal["leader", "follower"] | None = None


class JointReport(msgspec.Struct, frozen=True, gc=False):
    """Measured joints by name: rad (or m), rad/s, N m; ``velocities`` and ``efforts`` may be empty."""

    channel: ClassVar[str] = "joint_states"
    stamp: float
    positions: dict[str, float]
    velocities: dict[str, float] = {}
    efforts: dict[str, float] = {}
    tags: JointTags | None = None


class BatteryReport(msgspec.Struct, frozen=True):
    """The main battery: percent 0 to 100, volts, amperes out."""

    channel: ClassVar[str] = "battery"
    stamp: float
    percent: float | None = None
    voltage: float | None = None
    current: float | None = None


class GpsReport(msgspec.Struct, frozen=True):
    """A satellite fix. ``heading`` is degrees clockwise from north.

    A receiver without a fix reports ``fix_type`` none and no ``point``; that is not sent to the cloud.
    """

    channel: ClassVar[str] = "gps"
    stamp: float
    point: GeoPoint | None
    fix_type: str
    satellites: int | None = None
    heading: float | None = None
    horizontal_accuracy: float | None = None
    vertical_accuracy: float | None = None


class ImuReport(msgspec.Struct, frozen=True, gc=False):
    """Body rates (rad/s) and acceleration (m/s2), body FLU."""

    channel: ClassVar[str] = "imu"
    stamp: float
    gyro: Vector3
    accel: Vector3


class FlightStateReport(msgspec.Struct, frozen=True):
    """Whether an aircraft is in the air, and its flight mode; not sent while unknown."""

    channel: ClassVar[str] = "flight_state"
    stamp: float
    is_flying: bool
    flight_mode: str = ""


class StatusText(msgspec.Struct, frozen=True):
    """One text message of the autopilot; severity 0 (emergency) to 7 (debug), as in MAVLink and syslog."""

    text: str
    severity: int


class MissionProgress(msgspec.Struct, frozen=True):
    """Progress of the mission that is loaded on the autopilot, in the autopilot's own item numbers."""

    current: int
    total: int | None = None
    last_reached: int | None = None


class FlightControllerReport(msgspec.Struct, frozen=True):
    """Slowly changing state of the autopilot, with the fields of ``twin.flight_controller.v1``."""

    channel: ClassVar[str] = "flight_controller"
    stamp: float
    armed: bool
    mode: str
    failsafe: bool
    autopilot: str = ""
    vehicle: str = ""
    custom_mode: int | None = None
    system_status: int | None = None
    ready_to_arm: bool | None = None
    status_texts: tuple[StatusText, ...] = ()
    connected: bool = True
    system_id: int | None = None
    reboots: int = 0
    mission: MissionProgress | None = None
    home: GeoPoint | None = None


class MetricsReport(msgspec.Struct, frozen=True):
    """Figures for people (the ``metrics`` topic): power, navigation, errors, and ``more`` categories by name.

    An empty ``errors`` is sent too, to clear earlier errors; None leaves them out of the message.
    """

    channel: ClassVar[str] = "metrics"
    stamp: float
    power: dict[str, Any] = {}
    navigation: dict[str, Any] = {}
    errors: tuple[dict[str, Any], ...] | None = ()
    more: dict[str, Any] = {}

    @property
    def categories(self) -> dict[str, object]:
        """The categories to send, by name."""
        categories: dict[str, object] = {**self.more}
        if self.errors is not None:
            categories["errors"] = self.errors
        if self.power:
            categories["power"] = self.power
        if self.navigation:
            categories["navigation"] = self.navigation
        return categories


class NavigationReport(msgspec.Struct, frozen=True):
    """One status of one action (``navigate/status``); ``step``: the current item of a mission, from 0.

    ``remaining`` (metres) and ``eta`` (seconds) until the end, None while unknown; the cloud gets these two
    in ``metrics``.
    """

    channel: ClassVar[str] = "navigate_status"
    stamp: float
    action_id: str
    state: ActionState
    progress: float = 0.0
    message: str = ""
    step: int | None = None
    remaining: float | None = None
    eta: float | None = None


class TelemetryReport(msgspec.Struct, frozen=True):
    """One message of the ``telemetry`` topic: connected, vehicle_state, authority_lost, ...

    ``fields`` are placed beside ``type`` in the message.
    """

    channel: ClassVar[str] = "telemetry"
    stamp: float
    type: str
    fields: dict[str, Any] = {}


class PhotoReport(msgspec.Struct, frozen=True):
    """One requested picture: the file's bytes, its ``format`` (``jpeg``), and its size in pixels."""

    channel: ClassVar[str] = "photo"
    stamp: float
    image: bytes
    format: str
    width: int
    height: int


class DepthReport(msgspec.Struct, frozen=True):
    """One depth image: rows of little-endian values, ``uint16`` in mm or ``float32`` in m; 0 is no reading.

    ``sensor`` names the camera where a robot has several, in lower-case letters, digits and underscores.
    """

    channel: ClassVar[str] = "depth"
    stamp: float
    image: bytes
    width: int
    height: int
    dtype: Literal["uint16", "float32"]
    sensor: str = ""


class PointCloudReport(msgspec.Struct, frozen=True):
    """Points around a sensor: little-endian ``float32``, x y z in metres.

    With ``stride`` 6 each point also has r g b (0 to 255). ``sensor`` is as in ``DepthReport``.
    """

    channel: ClassVar[str] = "pointcloud"
    stamp: float
    points: bytes
    stride: Literal[3, 6]
    sensor: str = ""


class LogReport(msgspec.Struct, frozen=True):
    """One line for the ``driverlog`` topic; ``level`` is DEBUG, INFO, WARNING, ERROR or CRITICAL.

    ``about`` describes the source of the line: ``container_name``, ``driver_image``, versions.
    """

    channel: ClassVar[str] = "driverlog"
    stamp: float
    level: str
    message: str
    about: dict[str, Any] = {}


Report = (
    PoseReport
    | ScaleReport
    | JointReport
    | BatteryReport
    | GpsReport
    | ImuReport
    | FlightStateReport
    | FlightControllerReport
    | MetricsReport
    | NavigationReport
    | TelemetryReport
    | PhotoReport
    | DepthReport
    | PointCloudReport
    | LogReport
    | EventReport
)
