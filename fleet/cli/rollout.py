"""``fleet rollout``: the agent of an edge, and the control of roll-outs to many edges."""

from __future__ import annotations

import asyncio
import importlib.util
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from fleet.cli.output import ExitCode, Output, with_output
from fleet.client.local_user import local_user
from fleet.clock import SystemClock
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.runtime.cancellation import end_task
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.rollout.accounts import server_accounts
from fleet.rollout.agent import Agent
from fleet.rollout.driver import Driver, RolloutMissing
from fleet.rollout.edge_here import LocalEdge
from fleet.rollout.installation import Installation
from fleet.rollout.messages import SETTLED, ObservedState, Rollout
from fleet.rollout.settings import FILE, read_settings
from fleet.rollout.waves import EdgeStatus, RolloutPhase

if TYPE_CHECKING:
    from fleet.rollout.nats_store import NatsFleetStore

EXTRA = "roll-outs need the client of NATS: pip install 'zenoh-fleet[standby]'"
CODES: Mapping[RolloutPhase, ExitCode] = {
    RolloutPhase.RUNNING: ExitCode.OK,
    RolloutPhase.COMPLETED: ExitCode.OK,
    RolloutPhase.STOPPED: ExitCode.SOME_FAILED,
    RolloutPhase.ABORTED: ExitCode.SOME_FAILED,
}
DETACHED = "detached: edges that have started continue, no other starts until: fleet rollout resume"

store_option = click.option(
    "--store",
    "store_file",
    type=click.Path(dir_okay=False, path_type=Path),
    default=FILE,
    show_default=True,
    help="The file with the address of the store.",
)


@click.group()
def rollout() -> None:
    """Run the agent of an edge, and control roll-outs to many edges.

    fleet apply --fleet begins a roll-out.
    """


@rollout.command()
@click.argument("folder", default=".", type=click.Path(exists=True, file_okay=False, path_type=Path))
@with_output
def agent(out: Output, folder: Path) -> ExitCode:
    """Run the agent of the edge whose bundles are in FOLDER, until Ctrl-C.

    It installs the bundles meant for the edge, and reports its progress. The edge runs by itself, with fleet
    run FOLDER/current/fleet.yaml.
    """
    need_client()
    settings = read_settings(folder / FILE)
    if settings.edge is None:
        raise click.ClickException(f"{folder / FILE} names no edge: add  edge: NAME")
    end_logging = start_logging(LogSettings(logging.INFO, "json" if out.as_json else "text"))
    installation = Installation(folder)
    installation.lock()
    try:
        asyncio.run(_serve(settings.edge, installation))
    finally:
        installation.release()
        end_logging()
    record = installation.record()
    out.data({"edge": settings.edge, "stage": record.stage, "running": record.running})
    return ExitCode.OK


async def _serve(edge: str, installation: Installation) -> None:
    """Run the agent until a signal."""
    from fleet.rollout.nats_store import NatsEdgeStore  # noqa: PLC0415 - its package is an extra

    settings = read_settings(installation.folder / FILE)
    store, here = NatsEdgeStore(settings, edge), LocalEdge(edge, installation.file_in_use)
    ended = asyncio.Event()
    end_by_signal(ended.set)
    work = Agent(edge, installation, settings.trusted(), store, here, clock=SystemClock())
    running = asyncio.ensure_future(work.run(settings.look_every))
    ending = asyncio.ensure_future(ended.wait())
    try:
        await asyncio.wait({running, ending}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        ending.cancel()
        await end_task(running)
        await store.close()
    if not running.cancelled():
        running.result()


@rollout.command()
@store_option
@with_output
def status(out: Output, store_file: Path) -> ExitCode:
    """Show the last roll-out, edge by edge."""
    return asyncio.run(_status(out, store_file))


@rollout.command()
@store_option
@with_output
def resume(out: Output, store_file: Path) -> ExitCode:
    """Drive the roll-out in progress, after Ctrl-C or from another computer."""
    return asyncio.run(_resume(out, store_file))


@rollout.command()
@store_option
@with_output
def abort(out: Output, store_file: Path) -> ExitCode:
    """End the roll-out: no further edge starts, and an edge that is not done goes back.

    Edges that are done keep the new bundle. To revert them, roll out the old content with a higher version.
    """
    return asyncio.run(_abort(out, store_file))


@rollout.command()
@click.argument("edges", nargs=-1, required=True)
@click.option("--operator", "operators", multiple=True, help="An operator who may roll out; repeatable.")
@with_output
def accounts(out: Output, edges: tuple[str, ...], *, operators: tuple[str, ...]) -> None:
    """Print the accounts of a NATS server: for each of EDGES, and for the operators.

    An edge may only read its own desired state and write its own observed state.
    """
    text = server_accounts(edges, operators)
    out.data({"configuration": text})
    out.say(text)


def need_client() -> None:
    """Raise ClickException if the client of NATS is not installed."""
    if importlib.util.find_spec("nats") is None:
        raise click.ClickException(EXTRA)


def store_of(store_file: Path) -> NatsFleetStore:
    """Return the store of roll-outs named in a file."""
    need_client()
    from fleet.rollout.nats_store import NatsFleetStore  # noqa: PLC0415 - its package is an extra

    return NatsFleetStore(read_settings(store_file))


async def _status(out: Output, store_file: Path) -> ExitCode:
    """Show the last roll-out."""
    store = store_of(store_file)
    try:
        found, _ = await store.rollout()
        if found is None:
            raise RolloutMissing("there is no roll-out yet; begin one with: fleet apply --fleet")
        observed = await store.observed(found.progress.statuses)
    finally:
        await store.close()
    show(out, found, observed)
    return CODES[found.progress.phase]


async def _abort(out: Output, store_file: Path) -> ExitCode:
    """End the roll-out in progress."""
    store = store_of(store_file)
    try:
        found = await Driver(store, clock=SystemClock()).abort(local_user())
    finally:
        await store.close()
    out.data(msgspec.to_builtins(found.progress))
    out.say(_headline(found))
    return ExitCode.OK


async def _resume(out: Output, store_file: Path) -> ExitCode:
    """Drive the roll-out in progress."""
    store = store_of(store_file)
    try:
        return await drive(out, store)
    finally:
        await store.close()


async def drive(out: Output, store: NatsFleetStore) -> ExitCode:
    """Drive the roll-out in the store until it ends, or Ctrl-C."""
    detached = asyncio.Event()
    end_by_signal(detached.set)
    last: dict[str, object] = {}

    def show_progress(found: Rollout, observed: Mapping[str, ObservedState]) -> None:
        line = _headline(found)
        if last.get("line") != line:
            out.note(line)
        last.update(line=line, rollout=found, observed=observed)

    driving = asyncio.ensure_future(Driver(store, clock=SystemClock(), tell=show_progress).drive())
    ending = asyncio.ensure_future(detached.wait())
    await asyncio.wait({driving, ending}, return_when=asyncio.FIRST_COMPLETED)
    ending.cancel()
    if not driving.done():
        await end_task(driving)
        out.note(DETACHED)
        return ExitCode.INTERRUPTED
    found = driving.result()
    show(out, found, await store.observed(found.progress.statuses))
    return CODES[found.progress.phase]


def show(out: Output, found: Rollout, observed: Mapping[str, ObservedState]) -> None:
    """Show a roll-out, with a line for each edge that has started and is not simply done."""
    out.data({"rollout": msgspec.to_builtins(found), "observed": msgspec.to_builtins(observed)})
    out.say(_headline(found))
    for edge, status in found.progress.statuses.items():
        report = observed.get(edge)
        mine = report if report is not None and report.rollout == found.id else None
        if mine is None:
            out.say(f"{edge}: {'silent' if status is EdgeStatus.OPEN else status.value}")
        elif status is not EdgeStatus.DONE or mine.stage not in SETTLED:
            out.say(f"{edge}: {mine.stage.value}{f': {mine.why}' if mine.why else ''}")


def _headline(found: Rollout) -> str:
    """Return a roll-out on one line."""
    progress = found.progress
    done, failed = progress.count(EdgeStatus.DONE), progress.count(EdgeStatus.FAILED)
    words = f"roll-out {found.id} of {found.by}: {progress.phase.value}"
    words += f", {len(progress.statuses)} of {len(found.targets)} edges started, {done} done, {failed} failed"
    if overdue := progress.count(EdgeStatus.OVERDUE):
        words += f", {overdue} overdue"
    return f"{words}: {progress.why}" if progress.why else words
