"""Payload layouts of topics that have several published ones; fleet.yaml chooses one.

``joint/update`` is aggregated by default: in the flat form every number at the top level is read as a joint,
and in both other forms nothing shows which joints belong together. A depth image is an object by default;
string and list are older layouts.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import msgspec
from msgspec import UnsetType

from fleet.errors import WireError
from fleet.model.report import DepthReport, JointReport
from fleet.wire.joints import NEVER_JOINTS
from fleet.wire.rules import Layout
from fleet.wire.topics import JOINT_UPDATE

LayoutBody = dict[str, Any]
_SINGLE = {"position": "positions", "velocity": "velocities", "effort": "efforts"}


class MessageSource(msgspec.Struct, frozen=True):
    """Source of messages to the cloud: the fields that each of them carries.

    ``session_id`` is the edge's client id, ``sensor_id`` the sensor that measured; omitted when unset.
    ``fields``: the same fields by name. ``layout`` is the chosen payload layout of a topic with several,
    empty for the first one.
    """

    source_type: str
    session_id: str | UnsetType
    sensor_id: str | UnsetType
    fields: Mapping[str, str]
    layout: Layout = ""


def joint_messages(report: JointReport, by: MessageSource) -> list[tuple[str, LayoutBody]]:
    """Return the messages for joints in the layout of ``by``; the older topic is always aggregated.

    Raises WireError for a joint whose name is an envelope field, in the flat form.
    """
    tags = msgspec.to_builtins(report.tags) if report.tags is not None else {}
    role = tags.pop("role", None)
    if role and by.source_type.startswith("edge"):  # a simulated robot keeps sim
        tags["source_type"] = f"edge_{role}"
    common = {**by.fields, "timestamp": report.stamp, **tags}
    whole = {**common, **_aggregated(report)}
    own = _JOINTS.get(by.layout)
    laid = [{**common, **each} for each in own(report)] if own else [whole]
    return [*((JOINT_UPDATE, each) for each in laid), ("joint_states", whole)]


def depth_data(report: DepthReport, layout: Layout) -> LayoutBody:
    """Return the fields of a depth message: the image as bytes (base64 in JSON), or as a list.

    Raises WireError for a list of anything but uint16.
    """
    size: LayoutBody = {"width": report.width, "height": report.height, "dtype": report.dtype}
    if layout == "string":
        return {"data": report.image, **size}
    if layout == "list":
        if report.dtype != "uint16":
            raise WireError(f"a list holds uint16, not {report.dtype}", where="depth")
        return {"data": struct.unpack(f"<{report.width * report.height}H", report.image), **size}
    return {"data": {"depth_binary": report.image, **size}}


def _aggregated(report: JointReport) -> LayoutBody:
    """Return all joints in one message, by measured quantity."""
    sets = {"positions": report.positions, "velocities": report.velocities, "efforts": report.efforts}
    return {name: values for name, values in sets.items() if values}


def _flat(report: JointReport) -> list[LayoutBody]:
    """Return the positions at the top level of one message; this form has no velocities and efforts."""
    if taken := NEVER_JOINTS & report.positions.keys():
        raise WireError(f"no joint of the flat form can be called {min(taken)!a}", where=JOINT_UPDATE)
    return [dict(report.positions)]


def _single(report: JointReport) -> list[LayoutBody]:
    """Return one message per joint."""
    sets = {field: getattr(report, name) for field, name in _SINGLE.items()}
    return [
        {
            "type": "joint_state",
            "joint_name": joint,
            "joint_state": {field: values[joint] for field, values in sets.items() if joint in values},
        }
        for joint in report.positions
    ]


_JOINTS: Mapping[str, Callable[[JointReport], list[LayoutBody]]] = MappingProxyType(
    {"flat": _flat, "single": _single}
)
