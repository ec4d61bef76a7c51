"""Cause of an emergency stop: its sender and reason, as sent with a stop over the bus or by the supervisor.

An invalid cause never refuses a stop: it is shortened or left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from fleet.config.text import printable
from fleet.model.command import Transport
from fleet.model.event import Requester
from fleet.runtime.decoding import decode_json
from fleet.supervisor.protocol import LONGEST_REASON

LARGEST = 1 << 14  # bytes of the largest note that is decoded
_BY, _WHY, _ID = "by", "why", "id"
_TRANSPORTS: Mapping[Transport, str] = {
    Transport.CLOUD: "over the cloud",
    Transport.BUS: "over the bus",
    Transport.LOCAL: "on this computer",
    Transport.MISSION: "the edge itself",
}


class StopCause(msgspec.Struct, frozen=True):
    """Sender and reason of a stop; ``request`` identifies it, since one stop may use several transports."""

    asker: Requester
    reason: str = ""
    request: str = ""

    @property
    def sentence(self) -> str:
        """Sentence for people, shown with the robot until the release."""
        if not self.asker.name and self.reason:
            return self.reason
        requested = f"asked by {requester_text(self.asker)}"
        return f"{requested}: {self.reason}" if self.reason else requested


STOP_KEY_CAUSE = StopCause(Requester(Transport.BUS), "the stop key")
"""Cause of a stop that states none."""


def cause_in(parameters: Mapping[str, str]) -> StopCause:
    """Return the cause in the parameters of a query on the stop key; its sender is only claimed."""
    said = {name: _clipped(_read(parameters.get(name, ""))) for name in (_BY, _WHY, _ID)}
    if not (said[_BY] or said[_WHY]):
        return STOP_KEY_CAUSE
    return StopCause(Requester(Transport.BUS, said[_BY]), said[_WHY], said[_ID])


def parameters_of(by: str, why: str, request: str) -> dict[str, str]:
    """Return sender, reason and request id of a stop as query parameters, in hexadecimal."""
    said = {_BY: by, _WHY: why, _ID: request}
    return {name: _clipped(value).encode(errors="replace").hex() for name, value in said.items() if value}


def note_of(cause: StopCause) -> bytes:
    """Return the attachment of a published stop: sender, reason and request id.

    Empty if it cannot be encoded: the stop is sent without it.
    """
    try:
        return msgspec.json.encode(_cut(cause))
    except (ValueError, TypeError):
        return b""


def cause_noted(note: bytes) -> StopCause:
    """Return the cause in the attachment of a published stop, claimed; STOP_KEY_CAUSE if it is invalid."""
    if not note or len(note) > LARGEST:
        return STOP_KEY_CAUSE
    try:
        said = _cut(decode_json(note, StopCause))
    except (ValueError, RecursionError):  # includes msgspec's own errors
        return STOP_KEY_CAUSE
    return msgspec.structs.replace(said, asker=msgspec.structs.replace(said.asker, proven=False))


def local_cause(name: str, reason: str = "", request: str = "") -> StopCause:
    """Return the cause of a stop from this computer, whose sender is proven."""
    return StopCause(
        Requester(Transport.LOCAL, _clipped(name), proven=True), _clipped(reason), _clipped(request)
    )


def requester_text(requester: Requester) -> str:
    """Return a sender as text for people: ``anna (claimed, tele, over the cloud)``."""
    known = "proven" if requester.proven else "claimed"
    words = [known, *filter(None, [requester.source_type]), _TRANSPORTS[requester.transport]]
    return f"{requester.name or 'unknown sender'} ({', '.join(words)})"


def _cut(cause: StopCause) -> StopCause:
    """Return a cause with its texts shortened and safe to print."""
    who = cause.asker
    source = None if who.source_type is None else _clipped(who.source_type)
    requester = Requester(who.transport, _clipped(who.name), source, proven=who.proven)
    return StopCause(requester, _clipped(cause.reason), _clipped(cause.request))


def _clipped(text: str) -> str:
    """Return untrusted text shortened and safe to print."""
    return printable(text[:LONGEST_REASON])


def _read(digits: str) -> str:
    """Return the decoded text of a parameter; empty if it is invalid."""
    try:
        return bytes.fromhex(digits).decode(errors="replace")
    except ValueError:
        return ""
