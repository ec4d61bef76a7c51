"""``fleet diff`` and ``fleet apply``: a changed fleet file and its running edge."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

import click
import msgspec

from fleet.cli.output import ExitCode, Output, counted, with_output
from fleet.cli.rollout_start import RolloutOptions, roll_out, with_waves
from fleet.cli.times import when
from fleet.client.changes import request_changes
from fleet.client.local_user import local_user
from fleet.config.difference import ComparedFile, difference, not_shown, outline_of
from fleet.config.load import load
from fleet.errors import NotRunning
from fleet.host.edge.last_configuration import last_configuration
from fleet.model.change import Change, ChangeKind, ChangesRequest, Outcome
from fleet.spool.state_folder import state_folder

_SAID = {
    Outcome.PLANNED: "",
    Outcome.DONE: "done",
    Outcome.PARTLY: "partly done",
    Outcome.REFUSED: "refused",
    Outcome.FAILED: "failed",
}

SOON = 2.0  # s before a note that the edge has not answered yet
TAKES = "one robot after the other; a rebuilt one has 20 s to answer, a worker that is asked has 10 s"

file_argument = click.argument("file", default="fleet.yaml", type=click.Path())


@click.command()
@file_argument
@with_output
def diff(out: Output, file: str) -> ExitCode:
    """Show what FILE (fleet.yaml when left out) would change in the edge that runs with it.

    One line for each robot: rebuilt, settings only, added, removed, untouched; needs a restart; or would be
    refused now, with the reason. Secrets are masked. If the edge does not run, its last configuration is
    compared. Exit code 0: the same, 7: different.
    """
    loaded = load(file)
    outline = outline_of(loaded)
    answer = request_changes(outline.edge, file, ChangesRequest(file=str(Path(file).resolve())))
    if answer is None:
        folder = state_folder(outline.edge, loaded.config.edge.spool.path)
        changes = _since_the_last_run(out, outline, folder)
    else:
        changes = answer.changes
    _show(out, changes)
    same = all(change.kind is ChangeKind.UNTOUCHED for change in changes)
    return ExitCode.OK if same else ExitCode.SOME_FAILED


@click.command()
@click.argument("files", nargs=-1, type=click.Path())
@click.option("--force", is_flag=True, help="Also rebuild or remove moving robots, after stopping them.")
@click.option("--fleet", "is_fleet", is_flag=True, help="Roll FILES, which are bundles, out to their edges.")
@with_waves
@with_output
def apply(
    out: Output, files: tuple[str, ...], *, force: bool, is_fleet: bool, wanted: RolloutOptions
) -> ExitCode:
    """Apply the changed FILE (fleet.yaml when left out) to the edge that runs with it.

    Robot by robot; the others go on. A robot that is commanded, armed, moving or controlled by an operator is
    not rebuilt or removed; of its settings only stricter ones are applied. A failed change is reverted for
    that robot.

    Exit code 0: everything is applied, 5: nothing, 7: a part; fleet diff shows the rest.

    With --fleet, roll bundles out to many edges in waves. Exit code 0: every wave succeeded, 7: it ended
    before.
    """
    if is_fleet:
        if force:
            raise click.UsageError(
                "--force is for one edge; with --fleet each edge judges what may change now"
            )
        return roll_out(out, files, wanted)
    if len(files) > 1:
        raise click.UsageError("one fleet file at a time; several bundles need --fleet")
    file = files[0] if files else "fleet.yaml"
    edge = load(file).config.edge.id
    requested = ChangesRequest("apply", force, local_user(), str(Path(file).resolve()))
    with _report_waiting(out, edge):
        answer = request_changes(edge, file, requested)
    if answer is None:
        raise NotRunning(f"edge {edge} does not run; fleet run {file} starts it with this file")
    _show(out, answer.changes)
    return _code(answer.changes)


@contextlib.contextmanager
def _report_waiting(out: Output, edge: str) -> Iterator[None]:
    """Print a note if the edge does not answer soon."""
    timer = threading.Timer(SOON, out.note, [f"waiting for edge {edge}: {TAKES}"])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _code(changes: Iterable[Change]) -> ExitCode:
    """Return the exit code of all changes together."""
    requested = [change for change in changes if change.kind is not ChangeKind.UNTOUCHED]
    done = [change for change in requested if change.outcome is Outcome.DONE]
    if len(done) == len(requested):
        return ExitCode.OK
    partly = done or any(change.outcome is Outcome.PARTLY for change in requested)
    return ExitCode.SOME_FAILED if partly else ExitCode.REJECTED


def _since_the_last_run(out: Output, outline: ComparedFile, folder: Path) -> tuple[Change, ...]:
    """Return the changes since the last run of a stopped edge; raises NotRunning, StateError."""
    last = last_configuration(folder)
    if last is None:
        raise NotRunning(
            f"edge {outline.edge} does not run, and has left nothing to compare with in {folder}"
        )
    out.note(
        f"edge {outline.edge} does not run; compared with what it last ran with, since {when(last.stamp)}"
    )
    now = outline.digest(last.key.encode())
    return difference(last.outline, now, not_shown)


def _show(out: Output, changes: Iterable[Change]) -> None:
    """Show changes, each on one line; untouched robots together on one line."""
    changes = tuple(changes)
    out.data([msgspec.to_builtins(change) for change in changes])
    for change in changes:
        if change.kind is not ChangeKind.UNTOUCHED:
            out.say(line_of(change))
    kept = [change.name for change in changes if change.kind is ChangeKind.UNTOUCHED]
    if kept:
        out.say(f"untouched: {counted(len(kept), 'robot')}: {', '.join(kept)}")


def line_of(change: Change) -> str:
    """Return a change as text."""
    words = f"{change.name}: {change.kind.value}"
    if change.fields:
        words += f" because of {'; '.join(change.fields)}"
    said = _SAID[change.outcome]
    if change.why and not said:
        said = "needs one" if change.kind is ChangeKind.RESTART else "refused now"
    return f"{words} [{said}{': ' if change.why else ''}{change.why}]" if said else words
