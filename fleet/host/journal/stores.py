"""Opens the stores of an edge's process: the journal that safety needs, and the history."""

from __future__ import annotations

from pathlib import Path

from fleet.clock import Clock
from fleet.config.schema import Sections
from fleet.history.store import History, HistoryBounds
from fleet.host.journal.execution_journal import execution_journal_file
from fleet.host.journal.journal import Journal
from fleet.robot_config import MAIN


def history_bounds(config: Sections) -> HistoryBounds:
    """Return the bounds of the history in fleet.yaml."""
    kept = config.edge.history
    return HistoryBounds(kept.size << 20, kept.days * 86400.0)


def open_stores(
    edge: str, folder: Path, bounds: HistoryBounds, directory: Path, *, clock: Clock, worker: str = MAIN
) -> tuple[Journal, History]:
    """Open both; ``folder`` holds persistent state, ``directory`` is the runtime folder.

    A store that cannot be written reports it in its ``problem``.
    """
    history = History(folder, clock, bounds)
    journal = Journal(folder, clock, execution_journal_file(directory, edge, worker), also=history.write)
    return journal, history
