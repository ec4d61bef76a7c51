"""The state files of an edge that a backup contains, and their newest formats."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.console.people import FILE as PEOPLE
from fleet.history.store import FORMATS as HISTORY_FORMATS
from fleet.history.store import HISTORY
from fleet.host.edge.rehearsals import PASSES
from fleet.host.journal.journal_file import FORMATS as JOURNAL_FORMATS
from fleet.missions.store import FORMATS as MISSIONS_FORMATS
from fleet.missions.store import MISSIONS
from fleet.schedules.store import FILE as SCHEDULES
from fleet.schedules.store import FORMATS as SCHEDULES_FORMATS
from fleet.spool.state_folder import JOURNAL, SPOOL
from fleet.spool.store import FORMATS as SPOOL_FORMATS

NEWEST: Mapping[str, int] = {
    JOURNAL: len(JOURNAL_FORMATS),
    SPOOL: len(SPOOL_FORMATS),
    HISTORY: len(HISTORY_FORMATS),
    MISSIONS: len(MISSIONS_FORMATS),
    SCHEDULES: len(SCHEDULES_FORMATS),
}
"""The databases, each with the newest format number that this version reads."""
PLAIN = (PASSES, PEOPLE)
"""The other files: passed rehearsals, and people who may log in at the console."""
