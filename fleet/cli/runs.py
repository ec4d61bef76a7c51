"""Runs of missions on the command line: shown with a line per robot, followed to their end."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fleet.cli.output import ExitCode, Output, table_lines
from fleet.client.missions import MissionRun
from fleet.config.text import printable
from fleet.errors import TimedOut
from fleet.missions.report import RunRobot, RunState
from fleet.missions.words import OUTCOMES, phase_words, step_of

WIDE = 200  # columns of a table that is not on a terminal
EXITS = {"completed": ExitCode.OK, "completed_with_losses": ExitCode.SOME_FAILED, "unknown": ExitCode.UNKNOWN}


def state_line(state: RunState) -> str:
    """Return a run on one line."""
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
    """Return the present act of each robot of a run, or why it is out."""
    lines = []
    for each in state.robots:
        words = OUTCOMES.get(each.outcome, each.outcome) or "waits for its next step"
        if each.doing:
            words = "is a spare" if each.doing == "spare" else f"does {each.doing}"
        lines.append(f"{each.robot} ({each.role}) {words}" + (f": {each.reason}" if each.reason else ""))
    return lines


def run_lines(states: Sequence[RunState], width: int | None) -> list[str]:
    """Return runs as lines, with the parts of each robot below; ``width`` of the screen."""
    lines = [] if states else ["no run is under way"]
    for state in states:
        rows = [
            [
                each.robot,
                each.role,
                each.doing or each.outcome or "waits",
                " > ".join(each.lane) + _exit_reason(each),
            ]
            for each in state.robots
        ]
        shown = table_lines(["robot", "role", "now", "lane"], rows, (width or WIDE) - 2)
        lines += [printable(state_line(state))[:width], *(f"  {row}"[:width] for row in shown)]
    return lines


def _exit_reason(robot: RunRobot) -> str:
    """Return why a robot is out of its run, as the end of its parts."""
    return f" ({robot.reason})" if robot.reason else ""


def follow(out: Output, run: MissionRun) -> ExitCode:
    """Follow a run to its end; Ctrl-C leaves it running."""
    shown: set[str] = set()
    try:
        for state in run.follow():
            _show_changes(out, state, shown)
            if state.outcome:
                return _ended(out, state)
    except TimedOut as error:
        out.note(str(error))
    except KeyboardInterrupt:
        out.note("")  # the terminal has shown ^C on this line
        out.note(f"run {run.id} goes on without this command; end it with: fleet mission abort {run.id}")
        return ExitCode.INTERRUPTED
    out.data({"run": run.id, "outcome": "unknown"})
    return ExitCode.UNKNOWN


def _show_changes(out: Output, state: RunState, shown: set[str]) -> None:
    """Show the changes."""
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
