"""A rehearsal on the command line: follow it, then show its result."""

from __future__ import annotations

import time
from collections.abc import Iterator

import msgspec

from fleet.bus import keys
from fleet.cli.output import ExitCode, Output
from fleet.cli.runs import EXITS
from fleet.client.edges import Edges
from fleet.errors import Refused
from fleet.missions.rehearsal import RehearsalNote, RehearsalPoll, RehearsalResult, RehearsalState
from fleet.missions.report import MissionStartRequest
from fleet.missions.words import log_line

POLL_INTERVAL = 0.3  # s
QUIET = 2.0  # s without news after which the progress is shown


def follow_rehearsal(  # noqa: PLR0917 - all of one call
    out: Output, edges: Edges, edge: str, name: str, request: MissionStartRequest, again: str
) -> ExitCode:
    """Rehearse a mission, follow it to its end and show the result; ``again`` is the command that starts it.

    Raises Refused if it is not possible, TimedOut if the edge does not answer. Ctrl-C ends it.
    """
    key = keys.mission(edge, name)
    started = edges.request(key, RehearsalState, request, {"do": "rehearse"})
    if started.refusal:
        raise Refused(started.refusal)
    for role, robots in started.roles.items():
        out.note(f"{role}: {', '.join(robots)}")
    result = _followed(out, edges, key, started)
    out.data({"passed": result.passed, **msgspec.to_builtins(result)})
    for line in page(result, again):
        out.say(line)
    if result.passed:
        return ExitCode.OK
    code = EXITS.get(result.outcome, ExitCode.ENDED)
    return ExitCode.ENDED if code is ExitCode.OK else code


def _followed(out: Output, edges: Edges, key: str, started: RehearsalState) -> RehearsalResult:
    """Show notes until there is a result; raises Refused if the rehearsal fails."""
    known, shown_at = 0, time.monotonic()
    while True:
        state = edges.request(key, RehearsalState, RehearsalPoll(started.id, known), {"do": "rehearsal"})
        known += len(state.notes)
        for note in state.notes:
            out.note(note_line(note))
        if state.notes:
            shown_at = time.monotonic()
        elif time.monotonic() - shown_at >= QUIET:
            shown_at = time.monotonic()
            where = f"step {state.step}" if state.step else "the simulated robots start"
            out.note(f"{state.seconds:8.1f} s  {where}")
        if state.result is not None:
            return state.result
        if state.failure or state.refusal:
            raise Refused(f"it cannot be rehearsed: {state.failure or state.refusal}")
        time.sleep(POLL_INTERVAL)


def note_line(note: RehearsalNote) -> str:
    """Return a line of the log: simulated seconds, step and text."""
    return f"{note.at:8.1f} s  {log_line(note.text, note.robot, note.step)}"


def page(result: RehearsalResult, again: str) -> Iterator[str]:
    """Yield the lines of a rehearsal's result."""
    word = "passed" if result.passed else "not passed"
    yield f"rehearsal of {result.mission}: {word} ({result.outcome})"
    yield f"{result.seconds:g} s simulated in {result.took:g} s, seed {result.seed}"
    yield from _troubles(result)
    yield from ("", "robots")
    for each in result.robots:
        words = [f"{each.role}: {each.outcome or 'not through'}"] if each.role else []
        if each.battery_before is not None and each.battery_left is not None:
            words.append(f"battery {each.battery_before:.0f} % to {each.battery_left:.0f} %")
        yield f"  {each.robot}  {', '.join([*words, each.played_by])}"
    yield from ("", "timeline, simulated seconds")
    for part in result.timeline:
        ended = "       " if part.ended is None else f"{part.ended:7.1f}"
        how = f"{part.outcome or 'under way'}{f': {part.reason}' if part.reason else ''}"
        yield f"  {part.began:7.1f} {ended}  {part.step}  {part.robot} {part.does}: {how}"
    yield from _approaches(result)
    if result.assumed:
        yield from ("", "taken for granted", *(f"  {each}" for each in result.assumed))
    if result.passed:
        until = time.strftime("%H:%M", time.localtime(result.pass_until))
        yield from ("", f"start it: {again}" + (f"  (counts until {until})" if result.pass_until else ""))


def _troubles(result: RehearsalResult) -> Iterator[str]:
    """Yield the failures."""
    if result.troubles:
        yield from ("", "what failed", *(f"  {each}" for each in result.troubles))


def _approaches(result: RehearsalResult) -> Iterator[str]:
    """Yield the closest approaches of robots."""
    yield from ("", "closest approach")
    for each in result.approaches:
        kept = f"{each.kept:g} m are kept"
        yield f"  {each.metres:6.2f} m  {' and '.join(each.robots)}, after {each.at:g} s; {kept}"
    if not result.approaches:
        yield "  unknown: no two robots are placed in the site's frame, or none moved"
