"""Events of robots on the bus, and which of them are sent to the cloud.

A bus program may publish events of its own on the same key, ``{event_type, source, data}``. The fleet's own
events have the source ``fleet`` and more fields: the request that led to the event, and its sender.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec

from fleet.errors import WireError
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.report import Report
from fleet.runtime.decoding import json_decoder
from fleet.wire.samples import json_payload

FLEET: Literal["fleet"] = "fleet"
"""The ``source`` of the fleet's own events."""

CLOUD_EVENTS = frozenset(EventKind) - {
    EventKind.COMMAND,
    EventKind.OUTCOME,
    EventKind.STOP,
    EventKind.RELEASE,
    EventKind.SCHEDULE,
}
"""Kinds of events that go to the cloud. Requests and their results do not: the sender gets a status."""


class EventDocument(msgspec.Struct, frozen=True, omit_defaults=True):
    """Form of an ``event`` on the bus; the fields are those of ``EventReport``."""

    ts: float
    event_type: EventKind
    source: Literal["fleet"]
    text: str
    severity: Severity = Severity.INFO
    asker: Requester | None = None
    command: str = ""
    request: str = ""
    data: dict[str, Any] = {}

    @classmethod
    def of(cls, report: EventReport) -> EventDocument:
        """Return the document of a report."""
        return cls(
            report.stamp,
            report.kind,
            FLEET,
            report.text,
            report.severity,
            report.asker,
            report.command,
            report.request,
            report.data,
        )

    def report(self) -> EventReport:
        """Return the report of a document."""
        return EventReport(
            self.ts,
            self.event_type,
            self.text,
            self.severity,
            self.asker,
            self.command,
            self.request,
            self.data,
        )


class _EventSource(msgspec.Struct):
    """Only the source of an event."""

    source: Any = None


_SOURCE: msgspec.json.Decoder[_EventSource] = json_decoder(_EventSource)


def is_fleet_event(sample: bytes, channel: str) -> bool:
    """Return True for an event of a fleet process, False for a message of any other program."""
    if channel != EventReport.channel:
        return False
    try:
        return bool(_SOURCE.decode(json_payload(sample)).source == FLEET)
    except (
        WireError,
        msgspec.DecodeError,
        ValueError,
        RecursionError,
    ):  # the full decoder reports what is wrong
        return False


def unproven(report: Report) -> Report:
    """Return a bus report with the sender marked as not authenticated: any bus program can claim that."""
    if not isinstance(report, EventReport) or report.asker is None:
        return report
    return msgspec.structs.replace(report, asker=msgspec.structs.replace(report.asker, proven=False))


def event_body(report: EventReport) -> dict[str, object]:
    """Return an event as the cloud's workflows read it, all but its stamp.

    ``data`` holds the report's own data, and text, severity, and the request that led to the event.
    """
    details = {
        "text": report.text,
        "severity": report.severity.value,
        "command": report.command,
        "request": report.request,
        "asker": report.asker,
    }
    data = report.data | {name: value for name, value in details.items() if value}
    return {"event_type": report.kind.value, "source": FLEET, "data": data}
