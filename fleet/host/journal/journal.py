"""Journal of started commands and set emergency stops, which safety needs after the death of the process.

A discrete command is written to the execution journal before it is executed, and soon to disk, so that a
restart never repeats it; an emergency stop takes the same path. One thread writes for all robots of a
process, everything that waits in one commit; no event loop waits for the disk.
"""

from __future__ import annotations

import contextlib
import logging
import math
import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path

from fleet.clock import Clock
from fleet.errors import StateError
from fleet.host.journal.changes import CommandEnd, JournalChange, NetChanges
from fleet.host.journal.execution_journal import ExecutionJournal, JournalRow, Latched, StartedCommand
from fleet.host.journal.journal_file import LOST, JournalFile
from fleet.host.journal.past_commands import DONE, MOTION, InterruptedCommand, PastCommand, answer_to
from fleet.host.journal.unwritten_mark import UnwrittenMark
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.dedup_cache import KEPT, DedupCache
from fleet.model.command import Reply
from fleet.spool.database import BUSY

log = logging.getLogger(__name__)

GATHER = 0.05
"""Seconds in which changes are collected before a commit. A thread that woke for each command would compete
for the interpreter just when the command is on its way to the robot."""
LONGEST = 1 << 22
"""Bytes of commands that are kept in memory while the disk takes none."""
RETRY = 1.0  # s between attempts to write what the disk did not take
NOTED_AGAIN = 60.0  # s after which lasting motion is recorded again: old records are forgotten


def _forget(_change: JournalChange) -> None:
    """Discard a change."""


class RobotJournal:
    """Journal of one robot. ``put`` takes a change from any thread and never blocks; the default drops it."""

    def __init__(
        self,
        robot: str = "",
        put: Callable[[JournalChange], None] = _forget,
        *,
        latched: str = "",
        past: Sequence[PastCommand] = (),
        clock: Clock | None = None,
    ) -> None:
        self.latched = latched
        self.past = past
        self._robot = robot
        self._put = put
        self._clock = clock
        self._moved_at: float | None = None  # monotonic s at which present motion was recorded

    @property
    def cut_off(self) -> bool:
        """True when motion of an earlier process has no known end: the robot may still be moving."""
        return any(past.moves and not past.outcome for past in self.past)

    def moves(self, moving: bool) -> None:  # noqa: FBT001 - it says what is recorded
        """Record whether the robot may be moving because of this process; a repetition writes nothing."""
        if self._clock is None:
            return
        if not moving:
            if self._moved_at is not None:
                self._moved_at = None
                self._put(CommandEnd("ended", self._robot, MOTION))
            return
        now = self._clock.monotonic()
        if self._moved_at is None or now - self._moved_at > NOTED_AGAIN:
            self._moved_at = now
            self._put(StartedCommand(self._robot, MOTION, "motion", False, self._clock.time()))

    def latch(self, why: str) -> None:
        """Record an emergency stop, or with an empty ``why`` its release; from any thread.

        A cause that no file could hold, such as a name in another encoding, must not keep the stop from it.
        """
        self._put(Latched(self._robot, why.encode(errors="replace").decode()))

    def note(
        self,
        identity: str,
        name: str,
        *,
        action: bool = False,
        transport: str = "",
        receipt: Receipt | None = None,
    ) -> None:
        """Record that a command is being executed; without an identity it cannot repeat and is not kept.

        Its outcome is recorded once its ``receipt`` has it.
        """
        if identity and self._clock is not None:
            self._put(StartedCommand(self._robot, identity, name, action, self._clock.time(), transport))
        if receipt is not None:
            receipt.watch(partial(self._seen, identity))

    def end(self, identity: str, outcome: str) -> None:
        """Record the outcome of a command, as one word."""
        if identity:
            self._put(CommandEnd(outcome, self._robot, identity))

    def repeats(self, now: float) -> DedupCache[Receipt]:
        """Return the answers to commands of earlier processes; ``now``: monotonic seconds."""
        repeats: DedupCache[Receipt] = DedupCache()
        for past in self.past:
            if not past.action:
                repeats.first(past.identity, answer_to(past), now)
        return repeats

    def _seen(self, identity: str, reply: Reply) -> None:
        """Record the outcome in a command's reply."""
        if reply.done is not None:
            self.end(identity, DONE if reply.done else "failed")


class Journal:
    """Journal of one process. The workers of an edge share the database.

    While the disk fails, which is reported in ``problem``, robots keep obeying; what it did not take stays in
    the execution journal and in memory, and is written once the disk works. After a database that could not
    be read, or not be written at the start, the emergency stop of every robot is set, because a stop may have
    been set before and would be unknown.

    A set stop also stays in the execution journal until its release, so that it survives the loss of one of
    the two files.

    ``ends_are_told`` returns whether the ends of commands are still reported to their senders: a worker
    outlives its edge for a moment, and leaves them open for the next edge.

    ``also`` is called on the journal's thread after each round, for other writes to the disk; it never
    raises.
    """

    def __init__(
        self, folder: Path, clock: Clock, path: Path, also: Callable[[], None] = lambda: None
    ) -> None:
        self.problem = ""
        self.ends_are_reported: Callable[[], bool] = lambda: True
        self._also = also
        self._folder = folder
        self._clock = clock
        self._adding = threading.Lock()  # covers adding to both the queue and the execution journal
        self._set: dict[str, str] = {}  # robot to cause: the emergency stops that are set
        self._execution_journal = self._open_execution_journal(path)
        self._waiting: deque[JournalChange] = deque()
        self._unwritten = NetChanges()  # changes that the database does not have yet
        self._mark = UnwrittenMark(folder, path.name)
        self._closing = threading.Event()
        self._using = threading.Lock()  # one thread at a time: a reader would delay a writer
        self._try_again_at = 0.0  # monotonic s; the disk is left alone until then
        self._left = NetChanges()  # of earlier processes, while there is no database to have them
        self._file = self._open_file(self._all_rows())
        if self._file is None:
            with contextlib.suppress(OSError), self._all_rows(clear=False) as rows:
                self._left.add(rows)
        self._thread = threading.Thread(target=self._write, name="fleet-journal", daemon=True)
        self._thread.start()

    def _open_execution_journal(self, path: Path) -> ExecutionJournal | None:
        """Open the execution journal; None, with ``problem`` set, if that fails."""
        try:
            return ExecutionJournal(path)
        except OSError as error:
            self._fail(error)
            return None

    def _all_rows(self, *, clear: bool = True) -> AbstractContextManager[list[JournalRow]]:
        """Give the rows of all execution journals."""
        journal = self._execution_journal
        return nullcontext([]) if journal is None else journal.all_rows(clear=clear)

    def _open_file(
        self, left: AbstractContextManager[list[JournalRow]], *, within: float = math.inf
    ) -> JournalFile | None:
        """Open and migrate the database; None, with ``problem`` set, if it cannot be written."""
        try:
            return JournalFile(self._folder, left, self._mark, within=within)
        except (StateError, sqlite3.Error, OSError) as error:
            self._fail(error)
            return None

    def _open_again(self) -> None:
        """Open the database that could not be opened at the start.

        Its stops are those of earlier processes: what happened in this one is written over them.
        """
        file = self._open_file(self._all_rows(clear=False), within=BUSY)
        if file is not None:
            log.info("the journal of commands can be written again")
            self.problem = ""
            with self._using:
                self._file, self._left = file, NetChanges()

    def _add(self, row: JournalRow) -> None:
        """Write a row to the execution journal; never raises."""
        if self._execution_journal is not None:
            try:
                self._execution_journal.add(row)
            except Exception as error:  # noqa: BLE001 - a stop must not fail because of its record
                self._fail(error)

    def _clear(self) -> None:
        """Empty the execution journal, except for the stops that are set; the database has all."""
        if self._execution_journal is not None:
            self._execution_journal.clear()
            for robot, why in self._set.items():
                self._add(Latched(robot, why))

    def _shorten(self) -> None:
        """Bound what is kept while the disk takes nothing; the oldest commands are forgotten."""
        journal = self._execution_journal
        if journal is None or journal.length <= LONGEST:
            return
        self._gather()  # what has come since is in the file, too
        for changes in (self._left, self._unwritten):
            changes.shorten(LONGEST // 4)
        stops = self._left.latches | self._set | self._unwritten.latches
        try:
            journal.replace(
                [
                    *(Latched(*stop) for stop in stops.items()),
                    *self._left.started,
                    *self._unwritten.started,
                ]
            )
        except OSError as error:
            self._fail(error)

    def robot(self, name: str) -> RobotJournal:
        """Return the journal of one robot, with its records of earlier processes."""
        with self._using:
            self._gather()
            latched, past = self._recall(name)
        with self._adding:
            latched = self._set.get(name) or latched  # the database may not have it yet
            if latched:
                self._set[name] = latched
                self._add(Latched(name, latched))
            if latched == LOST:
                self._waiting.append(Latched(name, latched))
        if latched:
            log.warning("%s: the emergency stop is still set: %s", name, latched)
        return RobotJournal(name, self._put, latched=latched, past=past, clock=self._clock)

    def take_interrupted(self, names: Iterable[str]) -> list[InterruptedCommand]:
        """Return the commands of these robots that an earlier process did not see end; each once."""
        found: list[InterruptedCommand] = []
        try:
            with self._using:
                if (file := self._file) is not None:
                    for name in names:
                        found += file.take_interrupted(name, self._clock.time())
        except sqlite3.Error as error:
            self._fail(error)
        return found

    def close(self) -> None:
        """Write all waiting changes and close the files; a stop after that is left to the next process."""
        self._closing.set()
        self._thread.join()
        if self._file is not None:
            self._file.close()
        with self._adding:
            if not (self.problem or self._waiting or self._unwritten):
                self._clear()
            journal, self._execution_journal = self._execution_journal, None
            if journal is not None:
                journal.close()

    def _put(self, change: JournalChange) -> None:
        """Add a change; from here on, a started command or a stop survives the process."""
        if isinstance(change, CommandEnd) and not self.ends_are_reported():
            return
        with self._adding:
            match change:
                case StartedCommand():
                    self._add(change)
                case Latched():
                    self._add(change)
                    self._set[change.robot] = change.why
                    if not change.why:
                        del self._set[change.robot]
            self._waiting.append(change)

    def _gather(self) -> None:
        """Take what waits."""
        self._unwritten.add(self._waiting.popleft() for _ in range(len(self._waiting)))

    def _recall(self, name: str) -> tuple[str, list[PastCommand]]:
        """Return the robot's emergency stop and its commands, oldest first, also those not written yet."""
        latched, past = LOST, [*self._left.past(name, ())]
        if self._file is not None:
            try:
                latched, past = self._file.latched(name), self._file.past(name, self._clock.time())
            except sqlite3.Error as error:
                self._fail(error)
        return self._unwritten.latches.get(name, latched), [*self._unwritten.past(name, past)][-KEPT:]

    def _write(self) -> None:
        """Thread: write everything that waits in one commit."""
        closing = False
        while not closing:
            closing = self._closing.wait(GATHER)
            try:
                self._keep(last=closing)
            except Exception as error:
                log.exception("the journal's thread goes on")
                self._fail(error)
            self._also()

    def _keep(self, *, last: bool) -> None:
        """Write changes to disk; after that they are not needed in the execution journal.

        A disk that failed is tried again now and then, though nothing follows: a reboot empties the execution
        journal.
        """
        due = last or self._clock.monotonic() >= self._try_again_at
        if due and self._file is None:
            self._open_again()
        with self._using:
            self._gather()
            changed = bool(self._unwritten)
            if due:
                self._commit()
            self._mark.put(unwritten=self._unwritten.stops)
            with self._adding:
                if self._unwritten:
                    self._shorten()
                elif changed and not self._waiting:
                    self._clear()

    def _commit(self) -> None:
        """Write the changes that are not written yet; a failure is reported in ``problem``, once a kind."""
        if self._file is not None and not self._unwritten:
            return
        self._try_again_at = self._clock.monotonic() + RETRY
        if self._file is None:
            return
        try:
            self._file.commit(self._unwritten, self._clock.time())
        except sqlite3.Error as error:
            self._fail(error)
            return
        self._unwritten = NetChanges()
        self._try_again_at, self.problem = 0.0, ""

    def _fail(self, error: Exception) -> None:
        """Report that the journal is not being kept."""
        problem = f"the journal of commands is not kept: {error}"
        if problem != self.problem:
            log.error("%s", problem)
        self.problem = problem
