"""Changes of the journal, and the net effect of those that are not in the database yet."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import msgspec

from fleet.host.journal.execution_journal import JournalRow, Latched, StartedCommand
from fleet.host.journal.past_commands import PastCommand

ROW = 64  # bytes of a command's row besides its texts


class CommandEnd(msgspec.Struct, frozen=True):
    """End of a command; ``outcome`` is one word."""

    outcome: str
    robot: str
    identity: str


JournalChange = JournalRow | CommandEnd
"""One change of the journal; a row of ``ExecutionJournal`` is one that must not wait for the disk."""


class NetChanges:
    """Net effect of a series of changes.

    ``begun`` has each new command with its outcome, oldest first; ``ended`` the ends of earlier commands.
    """

    def __init__(self) -> None:
        self.commands: dict[tuple[str, str], tuple[StartedCommand, str]] = {}
        self.ended: dict[tuple[str, str], CommandEnd] = {}
        self.latches: dict[str, str] = {}

    def __bool__(self) -> bool:
        return bool(self.commands or self.ended or self.latches)

    @property
    def stops(self) -> bool:
        """True if an emergency stop that is set is among the changes."""
        return any(self.latches.values())

    @property
    def started(self) -> Iterator[StartedCommand]:
        """The new commands, oldest first."""
        return (started for started, _ in self.commands.values())

    def add(self, changes: Iterable[JournalChange]) -> None:
        """Add changes that were made later."""
        for change in changes:
            if isinstance(change, Latched):
                self.latches[change.robot] = change.why
                continue
            key = change.robot, change.identity
            if isinstance(change, StartedCommand):
                self.commands.pop(key, None)  # the newest is last
                self.commands[key] = change, ""
            elif key in self.commands:
                self.commands[key] = self.commands[key][0], change.outcome
            else:
                self.ended[key] = change

    def past(self, robot: str, before: Iterable[PastCommand]) -> Iterator[PastCommand]:
        """Yield a robot's commands after the changes; ``before`` are those of the database."""
        for past in before:
            key = robot, past.identity
            if key in self.ended:
                yield msgspec.structs.replace(past, outcome=self.ended[key].outcome)
            elif key not in self.commands:
                yield past
        for started, outcome in self.commands.values():
            if started.robot == robot:
                yield PastCommand(started.identity, started.name, started.action, outcome)

    def shorten(self, size: int) -> None:
        """Forget the oldest commands, beyond about ``size`` bytes; stops and releases stay."""
        sizes = [
            ROW + len(each.robot) + len(each.identity) + len(each.name) + len(each.transport)
            for each in self.started
        ]
        total = sum(sizes)
        over = sum(1 for before in itertools.accumulate(sizes, initial=0) if total - before > size)
        for key in list(itertools.islice(self.commands, over)):
            del self.commands[key]
        for key in list(itertools.islice(self.ended, max(len(self.ended) - size // ROW, 0))):
            del self.ended[key]
