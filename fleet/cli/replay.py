"""``fleet replay``: play a recording on a bus of its own, or through the present adapters."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from fleet.cli.output import ExitCode, Output, counted, with_output
from fleet.cli.times import length as length_option
from fleet.clock import SystemClock
from fleet.errors import Refused
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.record.child import EXTRA, is_installed
from fleet.runtime.event_loop import run

if TYPE_CHECKING:
    from fleet.replay.played_edge import PlayedEdge
    from fleet.replay.player import PlayedWindow
    from fleet.replay.through import Replayed

SHOWN = 20
"""Shown differences of one robot; ``--json`` has all."""


@click.command()
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@click.option("--speed", type=click.FloatRange(0.01, 1000.0), default=1.0, show_default=True, help="Times.")
@click.option("--start", callback=length_option, help="Begin at this offset: 30s, 10min, 1h.")
@click.option("--for", "length", callback=length_option, help="Length of the part. Left out: to its end.")
@click.option(
    "--through-adapters",
    is_flag=True,
    help="Compare the adapters' reports from its raw frames; plays nothing.",
)
@click.option("-f", "--file", type=click.Path(), help="The fleet file with the robots, for their adapters.")
@click.option("--robot", "names", multiple=True, help="Only this robot of the file; may be repeated.")
@with_output
def replay(
    out: Output,
    *,
    recording: Path,
    speed: float,
    start: float,
    length: float,
    through_adapters: bool,
    file: str | None,
    names: tuple[str, ...],
) -> ExitCode:
    """Play RECORDING, a file or a folder of fleet record, again.

    Its states, reports, runs and events are published on a separate bus, as those of an edge with the name
    replay-EDGE, in a folder that no other command uses. So no robot receives them, and  fleet ps  and fleet
    console  show it only if started as it says. Requests and stops in it are not repeated, and requests to
    its robots are refused.

    With --through-adapters the recorded bytes of the links are fed to the adapters of the fleet file, in the
    time of the recording and as fast as possible, and reports that differ from the recorded ones are shown.
    """
    if not is_installed():
        raise click.ClickException(EXTRA)
    if not through_adapters:
        from fleet.replay.player import PlayedWindow  # noqa: PLC0415 - its packages are an extra

        window = PlayedWindow(0.0 if math.isinf(start) else start, length, speed)
        return run(_play(out, recording, window))
    if file is None:
        raise click.UsageError("--through-adapters needs the fleet file of the robots: -f fleet.yaml")
    return _through(out, recording, file, names)


async def _play(out: Output, recording: Path, window: PlayedWindow) -> ExitCode:
    """Play until the end or a signal."""
    from fleet.replay.player import play, replay_directory  # noqa: PLC0415 - its packages are an extra

    directory = replay_directory()
    ended = asyncio.Event()
    end_by_signal(ended.set)

    def on_edge(edge: PlayedEdge) -> None:
        out.note(f"{edge.name} plays; see it with: FLEET_RUNTIME_DIR={directory} fleet ps --watch")

    count = await play(recording, window, directory, ended, SystemClock(), on_edge=on_edge)
    out.data({"recording": str(recording), "messages": count})
    out.say(f"{recording}: played {counted(count, 'message')}")
    return ExitCode.OK


def _through(out: Output, recording: Path, file: str, names: tuple[str, ...]) -> ExitCode:
    """Compare robot by robot; robots without frames are reported."""
    from fleet.config.load import load  # noqa: PLC0415 - slow to import
    from fleet.host.workers.worker_task import Importer, RobotTask  # noqa: PLC0415
    from fleet.replay.file import load_recording, replay_robot  # noqa: PLC0415 - its packages are an extra

    loaded = load(file)
    unknown = set(names) - {config.name for config, _ in loaded.robots}
    if unknown:
        raise Refused(f"{file} has no robot {min(unknown)!r}")
    importer = Importer(loaded.folder, loaded.registry)
    read = load_recording(recording)
    found: list[Replayed] = []
    refused: dict[str, str] = {}
    for config, plugin in loaded.robots:
        if names and config.name not in names:
            continue
        source = str(plugin.file.absolute()) if plugin.file else ""
        spec = importer.spec(RobotTask(config.name, plugin.name, source, loaded.given[config.name]))
        try:
            found.append(replay_robot(read, spec.plugin, spec.config))
        except Refused as error:
            refused[config.name] = str(error)
    return _report(out, found, refused)


def _report(out: Output, found: list[Replayed], refused: dict[str, str]) -> ExitCode:
    """Show the differences, and the robots that could not be compared."""
    out.data({"robots": msgspec.to_builtins(found), "not_replayed": refused})
    for each in found:
        for difference in each.found[:SHOWN]:
            out.say(str(difference))
        if len(each.found) > SHOWN:
            out.say(f"{each.robot}: and {len(each.found) - SHOWN} more (--json has all)")
        out.say(
            f"{each.robot}: {counted(len(each.found), 'difference')} in {counted(each.compared, 'report')}"
        )
        if not each.is_whole:
            out.note(
                f"{each.robot}: the recording begins when its link was open; the first seconds are left out, "
                "and what its adapter had learned before may differ"
            )
    for name, why in refused.items():
        out.note(f"{name}: not compared: {why}")
    if not found:
        return ExitCode.REJECTED
    return ExitCode.SOME_FAILED if any(each.found for each in found) else ExitCode.OK
