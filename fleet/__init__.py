"""The API for authors of adapters: the only module of ``fleet`` that an adapter imports.

The tools for simulators are in ``fleet.sim``, those for tests in ``fleet.testing``. Nothing inside ``fleet``
imports from here.

Names are loaded on first use, so that ``fleet --version`` need not load what it does not use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from fleet.version import __version__

if TYPE_CHECKING:
    from fleet.adapter import ADAPTER_API, Adapter, FrameAdapter, Robot, Send, Until
    from fleet.camera.picture import CameraText, photograph
    from fleet.clock import Clock, SystemClock
    from fleet.commands import Range, command
    from fleet.errors import (
        CommandError,
        ConfigError,
        Fault,
        FleetError,
        LinkError,
        LinkLost,
        LinkRefused,
        NotReady,
        Refused,
        TimedOut,
        Unsupported,
    )
    from fleet.link.backoff import backoff
    from fleet.link.base import Address, Link, Receiver
    from fleet.link.canbus.bus import BusText, OpenCanBus
    from fleet.link.canbus.frame import STANDARD_ID, CanBus, CanFrame
    from fleet.link.framing import DatagramFraming, LineFraming
    from fleet.link.latest_motion import LatestMotion, MotionFrames
    from fleet.link.motion_sender import POLL_INTERVAL, MotionSender
    from fleet.link.tap import LinkTap, tap_of
    from fleet.link.url import LinkText, open_link, opened_link, parse_link_url
    from fleet.model.body import BodyPart
    from fleet.model.command import Command
    from fleet.model.event import EventReport
    from fleet.model.geodesy import GeoOrigin, GeoPoint, geo_from_world, world_from_geo
    from fleet.model.geometry import (
        ZERO_VELOCITY,
        Pose,
        Quaternion,
        Vector3,
        Velocity,
        enu_rotation_from_ned,
        enu_yaw_from_heading,
        heading_from_enu_yaw,
        ned_from_enu,
        quaternion_from_euler,
        quaternion_from_yaw,
        rotate_to_world,
        wrap_angle,
    )
    from fleet.model.health import Health, Level
    from fleet.model.joints import JointRange
    from fleet.model.navigation import (
        Constraints,
        FlyMission,
        FollowPath,
        Goal,
        GoTo,
        PlanItem,
        Progress,
        RelativeMove,
        Task,
    )
    from fleet.model.polygon import Polygon, polygon_contains
    from fleet.model.report import (
        BatteryReport,
        DepthReport,
        FlightControllerReport,
        FlightStateReport,
        GpsReport,
        ImuReport,
        JointReport,
        JointTags,
        LogReport,
        MetricsReport,
        MissionProgress,
        NavigationReport,
        PhotoReport,
        PointCloudReport,
        PoseReport,
        Report,
        ScaleReport,
        StatusText,
        TelemetryReport,
    )
    from fleet.robot_config import AdapterConfig, FenceConfig, Limits, Positive, Separation
    from fleet.runtime.decoding import convert_strictly, decode_json, msgpack_decoder
    from fleet.runtime.interpreter import interpreter_settings
    from fleet.simulation import Simulation, SimulationStart
    from fleet.yaml_model import ExistingPath, Model, NewPath

_HOME = {
    "fleet.adapter": ("ADAPTER_API", "Until", "Adapter", "FrameAdapter", "Robot", "Send"),
    "fleet.camera.picture": ("CameraText", "photograph"),
    "fleet.clock": ("Clock", "SystemClock"),
    "fleet.commands": ("Range", "command"),
    "fleet.errors": (
        "CommandError",
        "ConfigError",
        "Fault",
        "FleetError",
        "LinkError",
        "LinkLost",
        "LinkRefused",
        "NotReady",
        "Refused",
        "TimedOut",
        "Unsupported",
    ),
    "fleet.link.backoff": ("backoff",),
    "fleet.link.base": ("Address", "Link", "Receiver"),
    "fleet.link.canbus.bus": ("BusText", "OpenCanBus"),
    "fleet.link.canbus.frame": ("CanBus", "CanFrame", "STANDARD_ID"),
    "fleet.link.framing": ("DatagramFraming", "LineFraming"),
    "fleet.link.latest_motion": ("LatestMotion", "MotionFrames"),
    "fleet.link.motion_sender": ("MotionSender", "POLL_INTERVAL"),
    "fleet.link.tap": ("LinkTap", "tap_of"),
    "fleet.link.url": ("LinkText", "open_link", "opened_link", "parse_link_url"),
    "fleet.model.command": ("Command",),
    "fleet.model.event": ("EventReport",),
    "fleet.model.geodesy": ("GeoOrigin", "GeoPoint", "geo_from_world", "world_from_geo"),
    "fleet.model.geometry": (
        "Pose",
        "Quaternion",
        "Vector3",
        "Velocity",
        "ZERO_VELOCITY",
        "enu_rotation_from_ned",
        "enu_yaw_from_heading",
        "heading_from_enu_yaw",
        "ned_from_enu",
        "quaternion_from_euler",
        "quaternion_from_yaw",
        "rotate_to_world",
        "wrap_angle",
    ),
    "fleet.model.body": ("BodyPart",),
    "fleet.model.health": ("Health", "Level"),
    "fleet.model.joints": ("JointRange",),
    "fleet.model.navigation": (
        "Constraints",
        "FlyMission",
        "FollowPath",
        "GoTo",
        "Goal",
        "PlanItem",
        "Progress",
        "RelativeMove",
        "Task",
    ),
    "fleet.model.polygon": ("Polygon", "polygon_contains"),
    "fleet.model.report": (
        "ScaleReport",
        "JointTags",
        "NavigationReport",
        "PhotoReport",
        "DepthReport",
        "PointCloudReport",
        "BatteryReport",
        "FlightControllerReport",
        "FlightStateReport",
        "GpsReport",
        "ImuReport",
        "JointReport",
        "LogReport",
        "MetricsReport",
        "MissionProgress",
        "PoseReport",
        "Report",
        "StatusText",
        "TelemetryReport",
    ),
    "fleet.robot_config": ("AdapterConfig", "FenceConfig", "Limits", "Positive", "Separation"),
    "fleet.runtime.decoding": ("convert_strictly", "decode_json", "msgpack_decoder"),
    "fleet.runtime.interpreter": ("interpreter_settings",),
    "fleet.simulation": ("Simulation", "SimulationStart"),
    "fleet.yaml_model": ("ExistingPath", "Model", "NewPath"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "ADAPTER_API",
    "POLL_INTERVAL",
    "STANDARD_ID",
    "ZERO_VELOCITY",
    "Adapter",
    "AdapterConfig",
    "Address",
    "BatteryReport",
    "BodyPart",
    "BusText",
    "CameraText",
    "CanBus",
    "CanFrame",
    "Clock",
    "Command",
    "CommandError",
    "ConfigError",
    "Constraints",
    "DatagramFraming",
    "DepthReport",
    "EventReport",
    "ExistingPath",
    "Fault",
    "FenceConfig",
    "FleetError",
    "FlightControllerReport",
    "FlightStateReport",
    "FlyMission",
    "FollowPath",
    "FrameAdapter",
    "GeoOrigin",
    "GeoPoint",
    "GoTo",
    "Goal",
    "GpsReport",
    "Health",
    "ImuReport",
    "JointRange",
    "JointReport",
    "JointTags",
    "LatestMotion",
    "Level",
    "Limits",
    "LineFraming",
    "Link",
    "LinkError",
    "LinkLost",
    "LinkRefused",
    "LinkTap",
    "LinkText",
    "LogReport",
    "MetricsReport",
    "MissionProgress",
    "Model",
    "MotionFrames",
    "MotionSender",
    "NavigationReport",
    "NewPath",
    "NotReady",
    "OpenCanBus",
    "PhotoReport",
    "PlanItem",
    "PointCloudReport",
    "Polygon",
    "Pose",
    "PoseReport",
    "Positive",
    "Progress",
    "Quaternion",
    "Range",
    "Receiver",
    "Refused",
    "RelativeMove",
    "Report",
    "Robot",
    "ScaleReport",
    "Send",
    "Separation",
    "Simulation",
    "SimulationStart",
    "StatusText",
    "SystemClock",
    "Task",
    "TelemetryReport",
    "TimedOut",
    "Unsupported",
    "Until",
    "Vector3",
    "Velocity",
    "__version__",
    "backoff",
    "command",
    "convert_strictly",
    "decode_json",
    "enu_rotation_from_ned",
    "enu_yaw_from_heading",
    "geo_from_world",
    "heading_from_enu_yaw",
    "interpreter_settings",
    "msgpack_decoder",
    "ned_from_enu",
    "open_link",
    "opened_link",
    "parse_link_url",
    "photograph",
    "polygon_contains",
    "quaternion_from_euler",
    "quaternion_from_yaw",
    "rotate_to_world",
    "tap_of",
    "world_from_geo",
    "wrap_angle",
]


def __getattr__(name: str) -> object:
    """Load a public name from the module it lives in (PEP 562)."""
    module = _MODULE_OF.get(name)
    if module is None:
        raise AttributeError(f"module 'fleet' has no attribute {name!r}")
    value = getattr(importlib.import_module(module), name)
    globals()[name] = value
    return value
