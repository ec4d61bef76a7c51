"""Answers on the bus who asked what of this edge's robots, and what became of it."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.errors import StateError
from fleet.history.event_filter import EventFilter, newest
from fleet.history.reader import read
from fleet.history.record import Record
from fleet.history.store import History
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

IN_ONE = 200  # events in one of the answers to a question


class HistoryService:
    """Takes questions for the history of one process's file, from any thread, one after the other.

    A query's payload is an ``EventFilter`` as JSON, or empty for the newest events of all robots. Each answer
    is a JSON list of ``Record``s; together they go from the oldest to the newest.
    """

    def __init__(self, history: History) -> None:
        self._history = history
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="fleet-recall")

    def asked(self, question: Query) -> None:
        """Take a question; its answers come from a thread of its own, which may wait for the disk."""
        try:
            self._reader.submit(self._answer, question)
        except RuntimeError:  # we are closed
            question.close()

    def close(self) -> None:
        """Answer nothing more."""
        self._reader.shutdown(cancel_futures=True)

    def found(self, wanted: EventFilter) -> list[Record]:
        """Return events from the disk and from memory; raises StateError."""
        waiting = self._history.waiting()  # first: what is written meanwhile is there twice, and not missing
        return newest([*read(self._history.folder, wanted), *waiting], wanted)

    def _answer(self, question: Query) -> None:
        """Answer a question; what cannot be read is told in the log, and nothing is answered."""
        try:
            wanted = decode_json(question.payload, EventFilter) if question.payload else EventFilter()
            for part in _parts(self.found(wanted)):
                question.reply(msgspec.json.encode(part))
        except (msgspec.DecodeError, StateError) as error:
            log.warning("a question for the history was not answered: %s", error)
        except Exception:
            log.exception("a question for the history was not answered")
        finally:
            question.close()


def _parts(records: Sequence[Record]) -> Iterator[Sequence[Record]]:
    """Yield so many events at a time; nothing to tell is an answer too."""
    for start in range(0, max(len(records), 1), IN_ONE):
        yield records[start : start + IN_ONE]
