"""Decoder of bus reports in their MQTT form: telemetry, metrics and log lines of other programs.

Such messages are open: fields unknown to this project are kept beside the known ones. The fields of the
report itself (``fields``, ``more``, ``about``), which an edge writes, are read too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import msgspec

from fleet.errors import WireError
from fleet.model.report import LogReport, MetricsReport, Report, TelemetryReport
from fleet.runtime.decoding import json_decoder
from fleet.wire.envelope import stamp_of
from fleet.wire.samples import json_payload, stamp_of_header
from fleet.wire.strict_json import child, text

LEVELS = frozenset({"DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL"})
ENVELOPE = frozenset({"ts", "timestamp", "type", "source_type", "session_id", "twin_uuid"})
"""Fields that any message may carry; the bridge replaces them with its own."""
_DECODER: msgspec.json.Decoder[dict[str, object]] = json_decoder(dict[str, Any])


def stamp_in(message: Mapping[str, object], sample: bytes) -> float:
    """Return when a message on the bus was made, Unix seconds: by its own stamp, else its sample's header.

    Raises WireError when neither has one.
    """
    stamp = stamp_of(message)
    stamp = stamp_of_header(sample) if stamp is None else stamp
    if stamp is None or not math.isfinite(stamp):
        raise WireError("is missing, and so is the sample's header", where="timestamp")
    return stamp


def object_in(sample: bytes, where: str) -> dict[str, object]:
    """Return the JSON object in a sample; raises WireError for anything else."""
    try:
        return _DECODER.decode(json_payload(sample))
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where=where) from None


def decode_published(channel: str, sample: bytes) -> Report:
    """Decode a sample of one of the channels ``PUBLISHED``; raises WireError."""
    message = object_in(sample, channel)
    return PUBLISHED[channel](message, stamp_in(message, sample))


def _telemetry(message: Mapping[str, object], stamp: float) -> TelemetryReport:
    """Read one telemetry message: its type and all other fields."""
    given = {name: value for name, value in message.items() if name not in ("ts", "type", "fields")}
    return TelemetryReport(stamp, text(message, "type"), {**given, **_part(message, "fields")})


def _metrics(message: Mapping[str, Any], stamp: float) -> MetricsReport:
    """Read metric categories: at the top level, as some programs write them, or in ``metrics``."""
    own = ENVELOPE | {"metrics", "more"}
    more = {name: value for name, value in message.items() if name not in own}
    more = {**more, **_part(message, "more"), **_part(message, "metrics")}
    known: dict[str, Any] = {"errors": None}
    for name in ("power", "navigation"):
        if isinstance(more.get(name), dict):
            known[name] = more.pop(name)
    if _are_objects(more.get("errors")):
        known["errors"] = tuple(more.pop("errors"))
    elif more.get("errors", 0) is None:
        del more["errors"]
    return MetricsReport(stamp, **known, more=more)


def _log(message: Mapping[str, Any], stamp: float) -> LogReport:
    """Read a log line and the fields about its source."""
    level = text(message, "level").upper()
    if level not in LEVELS:
        raise WireError(f"one of {', '.join(sorted(LEVELS))} is needed, not {level[:40]!a}", where="level")
    own = ENVELOPE | {"message", "level", "about"}
    about = {name: value for name, value in message.items() if name not in own}
    return LogReport(stamp, level, text(message, "message"), {**about, **_part(message, "about")})


def _part(message: Mapping[str, object], name: str) -> Mapping[str, object]:
    """Return the members of an optional object, empty when missing; raises WireError for anything else."""
    return child(message, name) if message.get(name) is not None else {}


def _are_objects(value: object) -> bool:
    """Return True for a list that holds only objects."""
    return isinstance(value, list) and all(isinstance(each, dict) for each in value)


PUBLISHED: Mapping[str, Callable[[Mapping[str, object], float], Report]] = MappingProxyType(
    {TelemetryReport.channel: _telemetry, MetricsReport.channel: _metrics, LogReport.channel: _log}
)
"""Decoder of each channel's messages."""
