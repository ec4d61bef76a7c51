"""The fleet.yaml of an edge for a page: its text, its errors, and its changes that are not in use yet."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.errors import Refused
from fleet.model.change import Change, ChangeKind, ChangesAnswer, ChangesRequest
from fleet.runtime.decoding import decode_json

ANSWER_WITHIN = 60.0  # s: the edge reads the file and inspects each drop-in file in a separate process


def fetch(edge: str, bus_sessions: Iterable[ZenohSession]) -> dict[str, object]:
    """Return the configuration of an edge, for a page; raises Refused without an answer. Blocks."""
    requested = msgspec.json.encode(ChangesRequest(text=True))
    for bus_session in bus_sessions:
        for _, data in bus_session.request(keys.changes(edge), requested, timeout=ANSWER_WITHIN):
            return _shown(decode_json(data, ChangesAnswer))
    raise Refused(f"edge {edge} does not send its configuration; it is shown only on its own computer")


def _shown(answer: ChangesAnswer) -> dict[str, object]:
    """Return an answer for a page."""
    waits = [change for change in answer.changes if change.kind is not ChangeKind.UNTOUCHED]
    return {
        "file": answer.file,
        "text": answer.text,
        "problems": [*([answer.refusal] if answer.refusal else []), *answer.problems],
        "warnings": list(answer.warnings),
        "changes": [_words(change) for change in waits],
    }


def _words(change: Change) -> str:
    """Describe a change that is not in use yet."""
    fields = f": {'; '.join(change.fields)}" if change.fields else ""
    why = f" ({change.why})" if change.why else ""
    return f"{change.name}: {change.kind.value}{fields}{why}"
