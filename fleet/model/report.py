"""What is learned about a robot. Each kind is one channel on the bus.

``stamp`` is Unix seconds at which it was measured. Unknown values are None or the report is not sent:
never a zero in place of silence.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import msgspec

from fleet.model.event import EventReport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState


class PoseReport(msgspec.Struct, frozen=True, gc=False):
    """Where the robot is, in the world frame (m, ENU) and how it is turned.

    ``frame_id`` is what readers in the cloud are told that frame is called; empty: they are not.
    """

    channel: ClassVar[str] = "position"
    stamp: float
    position: Vector3
    rotation: Quaternion
    frame_id: str = ""


class ScaleReport(msgspec.Struct, frozen=True):
    """How large the twin is drawn, by axis; 1 is as it was modelled."""

    channel: ClassVar[str] = "scale"
    stamp: float
    scale: Vector3


class JointTags(msgspec.Struct, frozen=True, omit_defaults=True):
    """What joints may be told with, by the names of ``joint/update``: who moves them, and what is seen then.

    ``source_subtype`` is how they are moved (a policy, a gamepad), ``workload_uuid`` the run that moves them.
    ``role``: which of two arms they are, where one twin has both: told as ``edge_leader``, ``edge_follower``.
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

    A receiver without a fix says so: ``fix_type`` none, and no ``point``. The cloud is not sent that.
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
    """Whether an aircraft is in the air; not sent while unknown."""

    channel: ClassVar[str] = "flight_state"
    stamp: float
    is_flying: bool
    flight_mode: str = ""


class StatusText(msgspec.Struct, frozen=True):
    """One line that the autopilot said; severity 0 (emergency) to 7 (debug)."""

    text: str
    severity: int


class MissionProgress(msgspec.Struct, frozen=True):
    """Where the mission that is loaded on the autopilot stands, in its own numbering."""

    current: int
    total: int | None = None
    last_reached: int | None = None


class FlightControllerReport(msgspec.Struct, frozen=True):
    """The autopilot's slowly changing state, as ``twin.flight_controller.v1`` wants it."""

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
    """Numbers for people: power, navigation, errors, and ``more`` categories by name (the ``metrics`` topic).

    Errors are told even when there are none any more; None says nothing about them.
    """

    channel: ClassVar[str] = "metrics"
    stamp: float
    power: dict[str, Any] = {}
    navigation: dict[str, Any] = {}
    errors: tuple[dict[str, Any], ...] | None = ()
    more: dict[str, Any] = {}

    @property
    def categories(self) -> dict[str, object]:
        """What is told, by category."""
        told: dict[str, object] = {**self.more}
        if self.errors is not None:
            told["errors"] = self.errors
        if self.power:
            told["power"] = self.power
        if self.navigation:
            told["navigation"] = self.navigation
        return told


class NavigationReport(msgspec.Struct, frozen=True):
    """One status of one action (``navigate/status``); ``step``: of a mission, the item it is at, from 0.

    ``remaining`` metres and ``eta`` seconds are left of it, as far as that is known; the cloud hears of them
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

    ``fields`` stand beside ``type`` in the message.
    """

    channel: ClassVar[str] = "telemetry"
    stamp: float
    type: str
    fields: dict[str, Any] = {}


class PhotoReport(msgspec.Struct, frozen=True):
    """One picture that was asked for: the file's bytes, its ``format`` (``jpeg``), and its size in pixels."""

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

    With ``stride`` 6 each has r g b (0 to 255) besides. ``sensor`` is as in ``DepthReport``.
    """

    channel: ClassVar[str] = "pointcloud"
    stamp: float
    points: bytes
    stride: Literal[3, 6]
    sensor: str = ""


class LogReport(msgspec.Struct, frozen=True):
    """One line for the ``driverlog`` topic; ``level`` is DEBUG, INFO, WARNING, ERROR or CRITICAL.

    ``about`` holds what else is told of who says it: ``container_name``, ``driver_image``, versions.
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
