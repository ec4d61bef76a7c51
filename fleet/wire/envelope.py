"""Envelope of every request: command name, sender, stamp and identity."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from typing import Any
from uuid import UUID

import msgspec

from fleet.errors import WireError
from fleet.model.command import Command, Origin, Transport
from fleet.wire.samples import json_payload, stamp_of_header
from fleet.wire.stops import stop_named
from fleet.wire.strict_json import kind, number, parse_object

MILLISECONDS_FROM = 1e11  # a stamp beyond this many seconds (year 5138) counts milliseconds

LONGEST_NAME = 64  # characters

_NAME = re.compile(f"[A-Za-z][A-Za-z0-9_.-]{{0,{LONGEST_NAME - 1}}}")


class BadCommand(WireError):
    """A request that cannot be decoded.

    ``command`` is its name and ``action_id`` its action, as far as they could be read, so that the sender can
    know which request was refused.
    """

    def __init__(self, error: WireError, *, command: str = "", action_id: str = "") -> None:
        super().__init__(str(error).removeprefix(f"{error.where}: "), where=error.where)
        self.command = command
        self.action_id = action_id


def name_of(message: Mapping[str, object]) -> str:
    """Return the command name of a request; older senders call the field ``type``. Raises WireError.

    A stop named in either field takes precedence, and is returned in its standard spelling.
    """
    stop = stop_named(message)
    if stop:
        return stop
    field = "command" if message.get("command") is not None else "type"
    name = message.get(field)
    if name is None:
        raise WireError("is missing", where="command")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise WireError(f"{str(name)[:40]!a} is not the name of a command", where=field)
    return name


def identity(payload: bytes, stamp: float | None, request_id: str, requested: object) -> str:
    """Return an id by which repeats of a request are recognised; empty when they cannot be.

    It is a digest of the sender's own id and the request (``requested``), since a sender may reuse an id for
    another request. Without an id it is a digest of the whole message, if that has a stamp.
    """
    if request_id:
        return digest(request_id.encode() + msgspec.json.encode(requested))
    return "" if stamp is None else digest(payload)


def digest(content: bytes) -> str:
    """Return a digest of ``content``: 32 hexadecimal digits."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def origin_and_stamp(
    message: Mapping[str, object], transport: Transport, *, strict: bool, twin: str = ""
) -> tuple[Origin, float | None]:
    """Return the sender of a message and its stamp (Unix seconds, None when not given).

    Raises WireError for a malformed field, and for a message that names another twin than ``twin``. When not
    ``strict`` (for a stop) a malformed field counts as not given, and nothing is raised.
    """
    try:
        _require_twin(message, twin)
        source_type, session = optional_word(message, "source_type"), optional_word(message, "session_id")
        return Origin(transport, source_type, session or ""), stamp_of(message)
    except WireError:
        if strict:
            raise
    source_type = tolerant(optional_word, message, "source_type", strict=False)
    session = tolerant(optional_word, message, "session_id", strict=False)
    return Origin(transport, source_type, session or ""), tolerant(stamp_of, message, strict=False)


def _require_twin(message: Mapping[str, object], twin: str) -> None:
    """Raise WireError when a message for one twin names another."""
    named = optional_word(message, "twin_uuid")
    if not named or not twin:
        return
    try:
        same = UUID(named) == UUID(twin)
    except ValueError:
        same = False
    if not same:
        raise WireError(f"{named[:40]!a} is not this twin, which is {twin}", where="twin_uuid")


def stop_requested(message: Mapping[str, object], transport: Transport) -> Command | None:
    """Return the stop that a message names on a topic with other commands; None when it names none."""
    name = stop_named(message) if "command" in message or "type" in message else ""
    if not name:
        return None
    origin, stamp = origin_and_stamp(message, transport, strict=False)
    return Command(name, origin=origin, stamp=stamp)


def tolerant(read: Callable[..., object], *arguments: object, strict: bool) -> Any:
    """Return the result of ``read``; when not ``strict``, None instead of a WireError."""
    try:
        return read(*arguments)
    except WireError:
        if strict:
            raise
        return None


def stamp_of(message: Mapping[str, object]) -> float | None:
    """Return the sender's Unix seconds from ``timestamp`` or ``ts``; None when there is none.

    Stamps beyond 1e11 are milliseconds. Raises WireError for anything that is not a number.
    """
    field = "timestamp" if message.get("timestamp") is not None else "ts"
    if message.get(field) is None:
        return None
    return seconds_of(number(message, field))


def sampled_object(sample: bytes) -> dict[str, Any]:
    """Decode a bus message; its stamp defaults to the header's, where 0 means unknown. Raises WireError."""
    message = parse_object(json_payload(sample))
    stamp = stamp_of_header(sample)
    if stamp and stamp_of(message) is None:
        message["timestamp"] = stamp
    return message


def seconds_of(stamp: float) -> float:
    """Return a stamp in seconds; large values are taken as milliseconds."""
    return stamp / 1000.0 if stamp > MILLISECONDS_FROM else stamp


def optional_word(message: Mapping[str, object], name: str) -> str | None:
    """Return an optional string field, None when missing or null; raises WireError for another type."""
    value = message.get(name)
    if value is not None and not isinstance(value, str):
        raise WireError(f"a string is needed, this is {kind(value)}", where=name)
    return value
