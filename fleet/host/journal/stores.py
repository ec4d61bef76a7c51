"""What a process of an edge keeps on disk, opened: the journal that safety needs, and the history."""

from __future__ import annotations

from pathlib import Path

from fleet.clock import Clock
from fleet.config.schema import Sections
from fleet.history.store import History, HistoryBounds
from fleet.host.journal.execution_journal import execution_journal_file
from fleet.host.journal.journal import Journal
from fleet.robot_config import MAIN


def history_bounds(config: Sections) -> HistoryBounds:
    """Return how much history fleet.yaml wants kept."""
    kept = config.edge.history
    return HistoryBounds(kept.size << 20, kept.days * 86400.0)


def open_stores(
    edge: str, folder: Path, bounds: HistoryBounds, directory: Path, *, clock: Clock, worker: str = MAIN
) -> tuple[Journal, History]:
    """Open both; ``folder`` is that of lasting state, ``directory`` the runtime folder.

    What cannot be written is told by their ``problem``.
    """
    history = History(folder, clock, bounds)
    journal = Journal(folder, clock, execution_journal_file(directory, edge, worker), also=history.write)
    return journal, history
