"""Who asked for an emergency stop, and why, as it comes with a stop on the bus or by the supervisor.

A stop is never refused for what is wrong with this: it is cut, or left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from fleet.config.text import printable
from fleet.model.command import Transport
from fleet.model.event import Requester
from fleet.runtime.decoding import decode_json
from fleet.supervisor.protocol import LONGEST_REASON

LARGEST = 1 << 14  # bytes of a note that is read
_BY, _WHY, _ID = "by", "why", "id"
_WAYS: Mapping[Transport, str] = {
    Transport.CLOUD: "over the cloud",
    Transport.BUS: "over the bus",
    Transport.LOCAL: "on this computer",
    Transport.MISSION: "the edge itself",
}


class StopCause(msgspec.Struct, frozen=True):
    """Who stops, in whose words why, and by which ``request``: one stop may come by several ways."""

    asker: Requester
    reason: str = ""
    request: str = ""

    @property
    def why(self) -> str:
        """Say it in a sentence: what stands at the robot until its release."""
        if not self.asker.name and self.reason:
            return self.reason
        asked = f"asked by {requester_text(self.asker)}"
        return f"{asked}: {self.reason}" if self.reason else asked


THE_KEY = StopCause(Requester(Transport.BUS), "the stop key")
"""Of a stop that says nothing of itself."""


def cause_in(parameters: Mapping[str, str]) -> StopCause:
    """Return what the parameters of a question on the stop key say; what they say is claimed."""
    said = {name: _clipped(_read(parameters.get(name, ""))) for name in (_BY, _WHY, _ID)}
    if not (said[_BY] or said[_WHY]):
        return THE_KEY
    return StopCause(Requester(Transport.BUS, said[_BY]), said[_WHY], said[_ID])


def parameters_of(by: str, why: str, request: str) -> dict[str, str]:
    """Return the parameters that say who stops, why, and by which request; in hexadecimal digits."""
    said = {_BY: by, _WHY: why, _ID: request}
    return {name: _clipped(value).encode(errors="replace").hex() for name, value in said.items() if value}


def note_of(cause: StopCause) -> bytes:
    """Return the note that goes beside a published stop: who stops, why, and by which request.

    Empty where that cannot be written: the stop goes without it.
    """
    try:
        return msgspec.json.encode(_cut(cause))
    except (ValueError, TypeError):
        return b""


def cause_noted(note: bytes) -> StopCause:
    """Return what the note of a published stop says; it is claimed. What cannot be read is the stop key."""
    if not note or len(note) > LARGEST:
        return THE_KEY
    try:
        said = _cut(decode_json(note, StopCause))
    except (ValueError, RecursionError):  # of which msgspec's own errors are some
        return THE_KEY
    return msgspec.structs.replace(said, asker=msgspec.structs.replace(said.asker, proven=False))


def local_cause(name: str, reason: str = "", request: str = "") -> StopCause:
    """Return the cause of a stop of this computer's own, whose sender is proven."""
    return StopCause(
        Requester(Transport.LOCAL, _clipped(name), proven=True), _clipped(reason), _clipped(request)
    )


def requester_text(asker: Requester) -> str:
    """Return an asker for people: ``anna (claimed, tele, over the cloud)``."""
    known = "proven" if asker.proven else "claimed"
    words = [known, *filter(None, [asker.source_type]), _WAYS[asker.way]]
    return f"{asker.name or 'somebody'} ({', '.join(words)})"


def _cut(cause: StopCause) -> StopCause:
    """Return a cause whose words are safe to show, and not too long."""
    who = cause.asker
    source = None if who.source_type is None else _clipped(who.source_type)
    asker = Requester(who.way, _clipped(who.name), source, proven=who.proven)
    return StopCause(asker, _clipped(cause.reason), _clipped(cause.request))


def _clipped(text: str) -> str:
    """Return text of others that is safe to show, and not too long."""
    return printable(text[:LONGEST_REASON])


def _read(digits: str) -> str:
    """Return the text of a parameter; nothing for what is none."""
    try:
        return bytes.fromhex(digits).decode(errors="replace")
    except ValueError:
        return ""
