"""Channels that carry several independent states, and which of their messages replace each other.

``telemetry`` carries events and, by ``type``, periodic state; ``metrics`` carries categories of different
programs. Periodic state is latest-value: the newest message of each part is sent, so that a state from
before an outage is not delivered after it as news.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import msgspec

from fleet.model.report import MetricsReport, Report, TelemetryReport
from fleet.wire.rules import TopicRule, TrafficClass

TELEMETRY_END = "telemetry_end"
_OF_ONE_STREAM = frozenset({"sensor", "stream_source", "stream_instance_id"})


class SubState(msgspec.Struct, frozen=True):
    """Rule for one type of a topic's messages that differs from the rule of the topic.

    ``max_rate`` in Hz (0: no limit), ``max_age`` in seconds (0: always worth sending). ``apart`` is the field
    each value of which is a separate state.
    """

    traffic: TrafficClass
    qos: int
    max_rate: float
    max_age: float = 0.0
    apart: str = ""


TELEMETRY: Mapping[str, SubState] = MappingProxyType(
    {
        "vehicle_state": SubState(TrafficClass.LATEST, 0, 5),
        "driver_info": SubState(TrafficClass.LATEST, 0, 1),
        "motor_status": SubState(TrafficClass.LATEST, 0, 2, apart="motor_id"),
        "camera_sync_frame": SubState(TrafficClass.EVENT, 2, 0, 30),
    }
)
"""Types of telemetry that are not plain events: periodic state, and the frames that time a picture."""

PARTED = frozenset({TelemetryReport.channel, MetricsReport.channel})
"""Channels that carry several states."""


def part_of(report: Report) -> str:
    """Return the part of its channel that a report belongs to; empty when the topic's rule applies."""
    if isinstance(report, MetricsReport):
        return ",".join(sorted(report.categories))
    if not isinstance(report, TelemetryReport) or report.type not in TELEMETRY:
        return ""
    apart = TELEMETRY[report.type].apart
    return f"{report.type} {str(report.fields.get(apart))[:60]}" if apart else report.type


def rule_of_part(rule: TopicRule, part: str) -> TopicRule:
    """Return the rule of a part: its own, but never more frequent or more durable than fleet.yaml allows."""
    own = TELEMETRY.get(part.partition(" ")[0])
    if own is None or rule.channel != TelemetryReport.channel:
        return rule
    traffic = max(own.traffic, rule.traffic)
    rates = [rate for rate in (own.max_rate, rule.max_rate) if rate]
    ages = [age for age in (own.max_age, rule.max_age) if age]
    return msgspec.structs.replace(
        rule,
        traffic=traffic,
        qos=own.qos if traffic is own.traffic else int(traffic.durable),
        max_rate=min(rates, default=0.0),
        max_age=min(ages, default=0.0),
    )


def is_telemetry_end(report: Report) -> bool:
    """Return True for the end of all telemetry of a twin, which closes its streams and recordings."""
    if not isinstance(report, TelemetryReport) or report.type != TELEMETRY_END:
        return False
    return not _OF_ONE_STREAM & report.fields.keys()
