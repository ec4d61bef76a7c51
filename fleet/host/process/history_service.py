"""Answers queries of the history on the bus: requests to this edge's robots, senders and outcomes."""

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

IN_ONE = 200  # events per reply to a query


class HistoryService:
    """Answers queries of the history of one process's file, from any thread, one after the other.

    A query's payload is an ``EventFilter`` as JSON, or empty for the newest events of all robots. Each reply
    is a JSON list of ``Record``s; together they are in order, oldest first.
    """

    def __init__(self, history: History) -> None:
        self._history = history
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="fleet-recall")

    def requested(self, question: Query) -> None:
        """Queue a query; it is answered on a separate thread, which may wait for the disk."""
        try:
            self._reader.submit(self._answer, question)
        except RuntimeError:  # closed
            question.close()

    def close(self) -> None:
        """Stop answering."""
        self._reader.shutdown(cancel_futures=True)

    def found(self, wanted: EventFilter) -> list[Record]:
        """Return matching events from disk and memory; raises StateError."""
        waiting = self._history.waiting()  # first: an event written meanwhile is found twice, not never
        return newest([*read(self._history.folder, wanted), *waiting], wanted)

    def _answer(self, question: Query) -> None:
        """Answer a query; if the history cannot be read, log it and close the query without a reply."""
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
    """Yield the records in parts; for none, one empty part."""
    for start in range(0, max(len(records), 1), IN_ONE):
        yield records[start : start + IN_ONE]
