"""A stop over the bus reaches an edge that has only begun to listen."""

import threading

import pytest

from fleet.bus import keys, stop_query
from fleet.bus.bus import join_control, open_edge
from fleet.bus.settings import BusSettings
from fleet.bus.stop_query import query_stop
from tests.tools.waiting import DEADLINE


class StartingEdge:
    """An edge that can be joined, and does not hear of stops before it ``begins``."""

    def __init__(self, runtime):
        self.bus = open_edge(BusSettings("yard-1"), runtime)
        self.session = join_control(BusSettings("yard-1"), runtime)
        self.stops = []

    def begin(self):
        self.bus.control.declare_queryable(keys.stop("yard-1"), self._stopped)

    def _stopped(self, question):
        self.stops.append(question.payload)
        question.reply(b'["rex"]')
        question.close()


@pytest.fixture
def edge(tmp_path_factory):
    made = StartingEdge(tmp_path_factory.mktemp("e"))
    yield made
    made.session.close()
    made.bus.close()


def test_a_stop_is_sent_until_the_edge_hears_it_and_then_no_more(edge, monkeypatch):
    monkeypatch.setattr(stop_query, "ANSWER_WITHIN", DEADLINE)
    asked, request = threading.Event(), edge.session.request

    def unanswered_at_first(*arguments, **options):
        answers = list(request(*arguments, **options))
        if not asked.is_set():
            assert answers == []
            asked.set()
            edge.begin()
        return iter(answers)

    monkeypatch.setattr(edge.session, "request", unanswered_at_first)
    answers = list(query_stop(edge.session, "yard-1", b"[]", {}))
    assert answers == [(keys.stop("yard-1"), b'["rex"]')]
    assert edge.stops == [b"[]"]


def test_a_stop_that_nobody_answers_ends(edge, monkeypatch):
    monkeypatch.setattr(stop_query, "ANSWER_WITHIN", 0.2)
    assert list(query_stop(edge.session, "yard-1", b"[]", {})) == []
