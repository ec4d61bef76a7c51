"""Queries of the history are answered in parts, from disk and memory, and always closed."""

import threading
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from fleet.errors import StateError
from fleet.history.event_filter import EventFilter
from fleet.history.record import Record
from fleet.history.store import History
from fleet.host.process import history_service
from fleet.host.process.history_service import IN_ONE, HistoryService
from fleet.model.event import EventKind, EventReport
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE


class Question:
    """A query that keeps its replies until it is closed."""

    def __init__(self, payload=b""):
        self.payload = payload
        self.replies = []
        self.closed = threading.Event()

    def reply(self, payload):
        assert not self.closed.is_set()
        self.replies.append([record.text for record in msgspec.json.decode(payload, type=list[Record])])

    def close(self):
        self.closed.set()


@pytest.fixture
def history(tmp_path):
    history = History(tmp_path / "state", ManualClock())
    yield history
    history.close()


def served(history, payload=b""):
    """Return a query that was answered."""
    service, question = HistoryService(history), Question(payload)
    service.requested(question)
    assert question.closed.wait(DEADLINE)
    service.close()
    return question


def add(history, number, robot="rex"):
    for each in range(number):
        history.add(robot, EventReport(1000.0 + each, EventKind.COMMAND, f"{robot} {each}"))


@pytest.mark.parametrize(
    ("number", "parts"),
    [
        (0, [0]),
        (1, [1]),
        (IN_ONE, [IN_ONE]),
        (IN_ONE + 1, [IN_ONE, 1]),
        (2 * IN_ONE, [IN_ONE, IN_ONE]),
        (1100, [IN_ONE] * 5),  # the newest 1000, when nothing is asked for
    ],
)
def test_an_answer_comes_in_parts_oldest_first(number, parts):
    records = [Record(1000.0 + each, "rex", EventKind.COMMAND, str(each)) for each in range(number)]
    waiting = SimpleNamespace(folder=Path("/nowhere"), waiting=lambda: records)
    question = served(waiting)
    assert [len(part) for part in question.replies] == parts
    expected = [str(each) for each in range(number)][-1000:]
    assert [text for part in question.replies for text in part] == expected


def test_events_of_the_disk_and_of_memory_are_told_together_and_once(history):
    add(history, 2)
    history.write()
    add(history, 3)  # the first two are the same events as those on disk
    assert served(history).replies == [["rex 0", "rex 1", "rex 2"]]


def test_an_event_that_is_written_while_the_disk_is_read_is_not_missed(history, monkeypatch):
    def read_then_written(folder, wanted, read=history_service.read):
        found = list(read(folder, wanted))
        history.write()
        return found

    monkeypatch.setattr(history_service, "read", read_then_written)
    add(history, 1)
    assert served(history).replies == [["rex 0"]]


def test_only_the_events_that_are_asked_for_are_told(history):
    add(history, 3)
    add(history, 1, robot="max")
    wanted = EventFilter(robots=("rex",), since=1001.0, most=1)
    assert served(history, msgspec.json.encode(wanted)).replies == [["rex 2"]]


@pytest.mark.parametrize("payload", [b"{", b"[]", b'{"most": "all"}', b"\xff"])
def test_a_question_that_cannot_be_read_is_closed_without_an_answer(history, payload, caplog):
    add(history, 1)
    assert served(history, payload).replies == []
    assert "a question for the history was not answered" in caplog.text
    assert "Traceback" not in caplog.text


@pytest.mark.parametrize(
    ("error", "traceback"), [(StateError("the disk is gone"), False), (ZeroDivisionError("oops"), True)]
)
def test_a_history_that_cannot_be_read_is_reported_and_the_question_closed(
    history, monkeypatch, caplog, error, traceback
):
    def fail(*_):
        raise error

    monkeypatch.setattr(history_service, "read", fail)
    assert served(history).replies == []
    assert (str(error) in caplog.text, "Traceback" in caplog.text) == (True, traceback)


def test_a_question_after_a_failed_one_is_answered(history):
    add(history, 1)
    service, bad, good = HistoryService(history), Question(b"{"), Question()
    service.requested(bad)
    service.requested(good)
    assert good.closed.wait(DEADLINE)
    service.close()
    assert good.replies == [["rex 0"]]


def test_a_question_that_comes_after_the_end_is_closed(history):
    service, question = HistoryService(history), Question()
    service.close()
    service.requested(question)
    assert (question.closed.is_set(), question.replies) == (True, [])
