"""Guarantees for every command, checked over all that was requested and what became of it.

The participants record events: the client (asked, replied), the host (admitted, stopped, released), the robot
(executed). ``broken`` is a pure function of all events.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator, Mapping

import msgspec


class What(enum.StrEnum):
    """What can happen to an ask, and to a robot."""

    RECEIVED = "received"  # a message that asks something; a repeat of it is received once more
    ADMITTED = "admitted"
    EXECUTED = "executed"
    REPLIED = "replied"
    STOPPED = "stopped"  # an emergency stop is set
    RELEASED = "released"  # and taken back


class Event(msgspec.Struct, frozen=True):
    """One thing that happened at ``at`` (monotonic s). ``request`` names the ask, ``robot`` the robot.

    ``stamp``: when it was asked (monotonic s). ``moves``: the robot moves because of it. ``ok``: the reply
    says that it was taken.
    """

    at: float
    what: What
    robot: str
    request: str = ""
    stamp: float | None = None
    moves: bool = False
    ok: bool = True


class Rules(msgspec.Struct, frozen=True):
    """What is promised. ``max_age``: s after which motion is not begun any more.

    ``gate``: what must come before an execution; ADMITTED where the host notes it. ``once``: a repeat is
    executed once only (velocities are not: the newest wins). ``replies``: every message is replied to.
    """

    max_age: float
    gate: What = What.ADMITTED
    once: bool = True
    replies: bool = True


def broken(events: Iterable[Event], rules: Rules) -> list[str]:
    """Return every promise that the events break, one line each, in their order; empty when all is well."""
    ordered = sorted(events, key=lambda event: event.at)
    found: list[str] = []
    for request, mine in _by_request(ordered).items():
        found += [f"{request}: {line}" for line in _broken_by(mine, rules)]
    for robot in sorted({event.robot for event in ordered}):
        found += [f"{robot}: {line}" for line in _moved_while_stopped(ordered, robot)]
    return found


def _by_request(events: Iterable[Event]) -> Mapping[str, list[Event]]:
    """Return the events of each ask, in order."""
    requests: dict[str, list[Event]] = {}
    for event in events:
        if event.request:
            requests.setdefault(f"{event.robot} {event.request}", []).append(event)
    return requests


def _broken_by(events: list[Event], rules: Rules) -> Iterator[str]:
    """Yield what the life of one ask breaks."""
    seen: dict[What, list[Event]] = {what: [] for what in What}
    for event in events:
        if event.what is What.EXECUTED:
            yield from _broken_by_execution(event, seen, rules)
        seen[event.what].append(event)
    received, replied = len(seen[What.RECEIVED]), len(seen[What.REPLIED])
    if rules.replies and received != replied:
        yield f"received {received} times, replied to {replied} times"
    if len({event.ok for event in seen[What.REPLIED]}) > 1:
        yield "replied to in two ways"


def _broken_by_execution(event: Event, seen: Mapping[What, list[Event]], rules: Rules) -> Iterator[str]:
    """Yield what one execution breaks, after what was seen of the same ask."""
    if not seen[rules.gate]:
        yield f"executed before it was {rules.gate}"
    if rules.once and seen[What.EXECUTED]:
        yield "executed twice"
    if any(not reply.ok for reply in seen[What.REPLIED]):
        yield "executed after it was refused"
    if event.moves and event.stamp is not None and event.at - event.stamp > rules.max_age:
        yield f"stale: it moves the robot {event.at - event.stamp:.3f} s after it was asked"


def _moved_while_stopped(events: Iterable[Event], robot: str) -> Iterator[str]:
    """Yield what moved a robot between an emergency stop and its release."""
    stopped = False
    for event in events:
        if event.robot != robot:
            continue
        if event.what in (What.STOPPED, What.RELEASED):
            stopped = event.what is What.STOPPED
        elif event.what is What.EXECUTED and event.moves and stopped:
            yield f"{event.request} moves it although it is stopped"
