"""Executions of a workflow on the edge: requests of the cloud and reports to it, in the SDK's form.

Topics: ``workflow/{uuid}/run`` and ``/cancel`` (``cyberwave.workers.hooks``), ``execution/started`` and
``execution/{execution}/finished`` (``cyberwave.workflow_executions``).
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Literal

import msgspec

from fleet.errors import WireError
from fleet.wire.encoding import encode_finite
from fleet.wire.envelope import optional_word, seconds_of
from fleet.wire.strict_json import child, finite, parse_object, text, without_nulls

LARGEST = 64 * 1024  # bytes
WorkflowOutcome = Literal["success", "error", "canceled"]


class WorkflowRequest(msgspec.Struct, frozen=True):
    """Request to start an execution with ``inputs``, or to cancel one.

    ``stamp`` is the time of the request (Unix s), None if unknown; ``by`` is the uuid of the sender.
    """

    execution: str
    inputs: Mapping[str, Any] = {}
    stamp: float | None = None
    by: str = ""


def decode_workflow(payload: bytes) -> WorkflowRequest:
    """Decode a request; raises WireError."""
    message = without_nulls(parse_object(payload, limit=LARGEST))
    return WorkflowRequest(
        text(message, "execution_uuid"),
        child(message, "inputs") if "inputs" in message else {},
        _stamp(message.get("requested_at")),
        optional_word(message, "requested_by_uuid") or "",
    )


def started(execution: str) -> bytes:
    """Return the report that an execution has started; the cloud repeats its request until then."""
    return encode_finite({"execution_uuid": execution, "source_type": "edge"})


def finished(status: WorkflowOutcome, message: str) -> bytes:
    """Return the report of the end of an execution; an empty ``message`` is omitted."""
    body = {"status": status, "error_message": message or None, "source_type": "edge"}
    return encode_finite(without_nulls(body))


def _stamp(given: object) -> float | None:
    """Return a time as Unix seconds: a number, or a date and time of ISO 8601; without a zone it is UTC."""
    if given is None:
        return None
    if isinstance(given, str):
        try:
            moment = datetime.fromisoformat(given)
        except ValueError:
            raise WireError(f"{given[:40]!a} is no date and time", where="requested_at") from None
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    return seconds_of(finite(given, "requested_at"))
