"""What a process of an edge keeps on disk, opened: the journal that safety needs, and the history."""

from __future__ import annotations

from pathlib import Path

from fleet.clock import Clock
from fleet.config.schema import FleetConfig
from fleet.history.store import Bounds, History
from fleet.host.begun import begun_file
from fleet.host.journal import Journal
from fleet.host.settings import MAIN
from fleet.spool.place import state_folder


def open_kept(
    config: FleetConfig, directory: Path, clock: Clock, worker: str = MAIN
) -> tuple[Journal, History]:
    """Open both; ``directory`` is the runtime folder. What cannot be written is told by their ``problem``."""
    edge, kept = config.edge.id, config.edge.history
    folder = state_folder(edge, config.edge.spool.path)
    history = History(folder, clock, Bounds(kept.size << 20, kept.days * 86400.0))
    journal = Journal(folder, clock, begun_file(directory, edge, worker), also=history.write)
    return journal, history
