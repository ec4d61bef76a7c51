"""Stored form of an event: an ``EventReport`` with its robot, bounded in size."""

from __future__ import annotations

from typing import Any

import msgspec

from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.runtime.decoding import decode_json

LONGEST_NAME = 128  # characters of a name: of a robot, a sender, a command
LONGEST_TEXT = 1000  # characters of a sentence
LONGEST_DATA = 4096  # bytes of data

_encode = msgspec.json.Encoder().encode

RecordRow = tuple[float, str, str, str, str, str, str, str, int, str, str, str]
"""Values of ``COLUMNS``."""
COLUMNS = "stamp, robot, kind, severity, text, way, asker, source_type, proven, command, request, data"


class Record(msgspec.Struct, frozen=True, omit_defaults=True):
    """One event of the history. ``stamp`` is Unix seconds; ``robot`` is empty for the edge itself.

    ``edge`` names the edge, in answers that combine several histories; in the store itself it is empty.
    """

    stamp: float
    robot: str
    kind: EventKind
    text: str
    severity: Severity = Severity.INFO
    asker: Requester | None = None
    command: str = ""
    request: str = ""
    data: dict[str, Any] = {}
    edge: str = ""


def row_of(robot: str, event: EventReport) -> RecordRow:
    """Return an event as a row; long texts are cut, data that is too large or not JSON is omitted."""
    requester = event.asker
    return (
        event.stamp,
        _clean(robot, LONGEST_NAME),
        event.kind.value,
        event.severity.value,
        _clean(event.text, LONGEST_TEXT),
        requester.transport.value if requester else "",
        _clean(requester.name, LONGEST_NAME) if requester else "",
        _clean(requester.source_type or "", LONGEST_NAME) if requester else "",
        int(requester.proven) if requester else 0,
        _clean(event.command, LONGEST_NAME),
        _clean(event.request, LONGEST_NAME),
        _data(event.data) if event.data else "",
    )


def record_of(row: RecordRow) -> Record:
    """Return the event of a row; raises ValueError for an invalid row."""
    stamp, robot, kind, severity, text, transport, name, source_type, proven, command, request, data = row
    requester = (
        Requester(Transport(transport), name, source_type or None, bool(proven)) if transport else None
    )
    return Record(
        stamp,
        robot,
        EventKind(kind),
        text,
        Severity(severity),
        requester,
        command,
        request,
        decode_json(data.encode(), dict[str, Any]) if data else {},
    )


def _clean(text: str, longest: int) -> str:
    """Return text cut to length, without surrogates: SQLite rejects those, and the whole commit with them."""
    text = text[:longest]
    return text if text.isascii() else text.encode(errors="replace").decode()


def _data(data: dict[str, object]) -> str:
    """Return data as JSON."""
    try:
        encoded = _encode(data)
    except Exception:  # noqa: BLE001 - an adapter may put anything into its events
        return '{"left_out":"it is no JSON"}'
    if len(encoded) > LONGEST_DATA:
        return f'{{"left_out":"{len(encoded)} bytes"}}'
    return encoded.decode()
