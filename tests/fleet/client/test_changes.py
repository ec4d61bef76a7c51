"""Asking a running edge for a change of its configuration."""

import pytest

from fleet.client import changes
from fleet.errors import NotRunning, Refused, TimedOut
from fleet.model.change import ChangesAnswer, ChangesRequest
from fleet.model.state import EdgeState


class Answers:
    """Edges that answer so."""

    def __init__(self, answer):
        self.answer = answer

    def reach(self, _file):
        if isinstance(self.answer, NotRunning):
            raise self.answer
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def request(self, key, _kind, _requested, *, within):
        assert (key, within) == ("fleet/yard-1/changes", changes.APPLY_WITHIN)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def edges(self):
        return [EdgeState(edge="yard-1", version="0.1.0", stamp=0.0, uptime=1.0, health="ok")]


def requested(monkeypatch, answer):
    monkeypatch.setattr(changes, "Edges", Answers(answer))
    return changes.request_changes("yard-1", "fleet.yaml", ChangesRequest("apply"))


def test_an_answer_is_returned_and_an_edge_that_does_not_run_has_none(monkeypatch):
    assert requested(monkeypatch, ChangesAnswer()) == ChangesAnswer()
    assert requested(monkeypatch, NotRunning("no edge is running here")) is None


def test_a_refusal_is_an_error_with_every_problem(monkeypatch):
    with pytest.raises(Refused, match="edge yard-1: it cannot be used; line 1; line 2"):
        requested(monkeypatch, ChangesAnswer(refusal="it cannot be used", problems=("line 1", "line 2")))


def test_silence_is_reported_with_the_version_of_the_edge(monkeypatch):
    with pytest.raises(TimedOut, match=r"it runs fleet 0\.1\.0; if that is older, restart it"):
        requested(monkeypatch, TimedOut("no answer"))
