"""What the author of a robot imports. Nothing inside ``fleet`` imports from here.

Names are loaded on first use, so that ``fleet --version`` need not load what it does not use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from fleet.version import __version__

if TYPE_CHECKING:
    from fleet.adapter import Adapter, FrameAdapter, Robot, Send
    from fleet.clock import Clock
    from fleet.commands import Range, command
    from fleet.errors import (
        Fault,
        LinkLost,
        LinkRefused,
        NotReady,
        Refused,
        TimedOut,
        Unsupported,
    )
    from fleet.link.canbus.frame import CanFrame as CanFrame
    from fleet.link.framing import DatagramFraming, LineFraming
    from fleet.link.url import LinkText, open_link, opened_link
    from fleet.model.command import Command
    from fleet.model.geodesy import GeoOrigin, GeoPoint
    from fleet.model.geometry import Pose, Quaternion, Vector3, Velocity, quaternion_from_yaw
    from fleet.model.health import Health, Level
    from fleet.model.navigation import (
        FlyMission,
        FollowPath,
        Goal,
        GoTo,
        Progress,
        RelativeMove,
        Task,
    )
    from fleet.model.report import BatteryReport, PoseReport
    from fleet.robot_config import AdapterConfig, Limits

_HOME = {
    "fleet.adapter": ("Adapter", "FrameAdapter", "Robot", "Send"),
    "fleet.clock": ("Clock",),
    "fleet.commands": ("Range", "command"),
    "fleet.errors": (
        "Fault",
        "LinkLost",
        "LinkRefused",
        "NotReady",
        "Refused",
        "TimedOut",
        "Unsupported",
    ),
    "fleet.link.canbus.frame": ("CanFrame",),
    "fleet.link.framing": ("LineFraming", "DatagramFraming"),
    "fleet.link.url": ("LinkText", "open_link", "opened_link"),
    "fleet.model.command": ("Command",),
    "fleet.model.geodesy": ("GeoOrigin", "GeoPoint"),
    "fleet.model.geometry": ("Pose", "Quaternion", "Vector3", "Velocity", "quaternion_from_yaw"),
    "fleet.model.health": ("Health", "Level"),
    "fleet.model.navigation": (
        "FlyMission",
        "FollowPath",
        "Goal",
        "GoTo",
        "Progress",
        "RelativeMove",
        "Task",
    ),
    "fleet.model.report": ("BatteryReport", "PoseReport"),
    "fleet.robot_config": ("AdapterConfig", "Limits"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Adapter",
    "AdapterConfig",
    "BatteryReport",
    "CanFrame",
    "Clock",
    "Command",
    "DatagramFraming",
    "Fault",
    "FlyMission",
    "FollowPath",
    "FrameAdapter",
    "GeoOrigin",
    "GeoPoint",
    "GoTo",
    "Goal",
    "Health",
    "Level",
    "Limits",
    "LineFraming",
    "LinkLost",
    "LinkRefused",
    "LinkText",
    "NotReady",
    "Pose",
    "PoseReport",
    "Progress",
    "Quaternion",
    "Range",
    "Refused",
    "RelativeMove",
    "Robot",
    "Send",
    "Task",
    "TimedOut",
    "Unsupported",
    "Vector3",
    "Velocity",
    "__version__",
    "command",
    "open_link",
    "opened_link",
    "quaternion_from_yaw",
]


def __getattr__(name: str) -> object:
    """Load a public name from the module it lives in (PEP 562)."""
    module = _MODULE_OF.get(name)
    if module is None:
        raise AttributeError(f"module 'fleet' has no attribute {name!r}")
    value = getattr(importlib.import_module(module), name)
    globals()[name] = value
    return value
