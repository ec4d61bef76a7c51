"""Messages of one channel that are several states, and which of them replace each other.

``telemetry`` carries events and, by their ``type``, periodic state; ``metrics`` carries categories that
different programs know. What is told again and again is latest-value: of each part the newest crosses, and
what was true before an outage does not arrive after it as news.
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
    """How one type of a topic's messages is carried, where that is not as its row says.

    ``max_rate`` in Hz (0: no limit), ``max_age`` in seconds (0: always worth sending). ``apart`` is the field
    whose values are states of their own.
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
"""The types of telemetry that are no plain events: periodic state, and what ties a picture to its time."""

PARTED = frozenset({TelemetryReport.channel, MetricsReport.channel})
"""The channels whose messages are several states."""


def part_of(report: Report) -> str:
    """Return which of its channel's states a report is; empty for what is carried as the row says."""
    if isinstance(report, MetricsReport):
        return ",".join(sorted(report.categories))
    if not isinstance(report, TelemetryReport) or report.type not in TELEMETRY:
        return ""
    apart = TELEMETRY[report.type].apart
    return f"{report.type} {str(report.fields.get(apart))[:60]}" if apart else report.type


def rule_of_part(rule: TopicRule, part: str) -> TopicRule:
    """Return how a part is carried: as its own line says, never oftener or surer than fleet.yaml wants."""
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


def ends_every_stream(report: Report) -> bool:
    """Return True for an end of the whole twin's telemetry, which closes all its streams and recordings."""
    if not isinstance(report, TelemetryReport) or report.type != TELEMETRY_END:
        return False
    return not _OF_ONE_STREAM & report.fields.keys()
