"""Runs of missions on the command line: found, shown as a line for each robot, followed to their end."""

from __future__ import annotations

import time

import msgspec

from fleet.cli.edges import Edges
from fleet.cli.output import ExitCode, Output
from fleet.errors import Refused
from fleet.missions.report import RunState
from fleet.missions.words import OUTCOMES, phase_words, step_of

LOOK = 0.5  # s
RUN_FILES = frozenset({".yaml", ".yml", ".plan", ".json"})
EXITS = {"completed": ExitCode.OK, "completed_with_losses": ExitCode.SOME_FAILED, "unknown": ExitCode.UNKNOWN}
SILENT = 10.0  # s without a word of the edge after which nobody knows; the edge may be restarting


def one_run(edges: Edges, run: str, *, ended: bool = False) -> RunState:
    """Return a run by its id or its beginning; left out, the only one under way, or the newest. Refused."""
    found = [each for each in edges.runs("*") if ended or not each.outcome]
    if run:
        found = [each for each in found if each.run.startswith(run)]
    elif ended:
        found = sorted(found, key=lambda each: each.started)[-1:]
    if len(found) == 1:
        return found[0]
    what = f"run {run!r}" if run else "run"
    if not found:
        raise Refused(f"there is no {what}" + ("" if ended else " under way"), hint="fleet mission ps --all")
    raise Refused(f"there are several: {', '.join(each.run for each in found)}", hint="name one")


def state_line(state: RunState) -> str:
    """Return a run in one line."""
    words = f"run {state.run} of {state.mission} "
    if state.outcome:
        words += f"has ended: {state.outcome.replace('_', ' ')}"
    else:
        words += f"{phase_words(state.phase, state.step)} ({state.seconds:.0f} s since its start)"
    if state.waits_for:
        words += f": {state.waits_for}"
    if state.reason:
        words += f": {state.reason}"
    if state.question is not None:
        left, otherwise = state.question.seconds, state.question.on_timeout
        words += f". It asks: {state.question.text} Answer within {left:.0f} s, else: {otherwise}"
    return words + (f". {state.problem}" if state.problem else "")


def robot_lines(state: RunState) -> list[str]:
    """Return what each robot of a run does, or how it is out."""
    lines = []
    for each in state.robots:
        words = OUTCOMES.get(each.outcome, each.outcome) or "waits for its next step"
        if each.doing:
            words = "is a spare" if each.doing == "spare" else f"does {each.doing}"
        lines.append(f"{each.robot} ({each.role}) {words}" + (f": {each.reason}" if each.reason else ""))
    return lines


def follow(out: Output, edges: Edges, run: str) -> ExitCode:
    """Follow a run to its end; ctrl-c leaves it running."""
    shown: set[str] = set()
    heard = time.monotonic()
    try:
        while True:
            found = edges.runs(run)
            if found:
                heard = time.monotonic()
                _tell(out, found[0], shown)
                if found[0].outcome:
                    return _ended(out, found[0])
            elif time.monotonic() - heard > SILENT:
                out.note(f"run {run}: the edge does not answer; nobody knows")
                out.data({"run": run, "outcome": "unknown"})
                return ExitCode.UNKNOWN
            time.sleep(LOOK)
    except KeyboardInterrupt:
        out.note("")  # the terminal has shown ^C on this line
        out.note(f"run {run} goes on without this command; end it with: fleet mission abort {run}")
        return ExitCode.INTERRUPTED


def _tell(out: Output, state: RunState, shown: set[str]) -> None:
    """Show what is new."""
    run, step = f"the run {phase_words(state.phase, state.step)}", step_of(state.step)
    lines = [run + (f": {state.waits_for}" if state.waits_for else "")] if not state.outcome else []
    if state.question is not None:
        lines.append(f"it asks: {state.question.text}  fleet mission answer continue|abort {state.run}")
    active = [each for each in state.robots if each.doing and each.doing != "spare"]
    lines += [
        f"step {step}: {line}" for line in robot_lines(msgspec.structs.replace(state, robots=tuple(active)))
    ]
    for line in lines:
        if line not in shown:
            shown.add(line)
            out.note(line)


def _ended(out: Output, state: RunState) -> ExitCode:
    """Show how a run ended; return its exit code."""
    out.data(msgspec.to_builtins(state))
    out.say(state_line(state))
    for line in robot_lines(state):
        out.say(f"  {line}")
    return EXITS.get(state.outcome, ExitCode.ENDED)
