"""Asking a running edge for a change of its configuration."""

import pytest

from fleet.client import changes
from fleet.errors import NotRunning, Refused, TimedOut
from fleet.model.change import ChangesAnswer, ChangesAsked
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

    def one(self, key, _kind, _asked, *, within):
        assert (key, within) == ("fleet/yard-1/changes", changes.APPLY_WITHIN)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def edges(self):
        return [EdgeState(edge="yard-1", version="0.1.0", stamp=0.0, uptime=1.0, health="ok")]


def asked(monkeypatch, answer):
    monkeypatch.setattr(changes, "Edges", Answers(answer))
    return changes.ask_changes("yard-1", "fleet.yaml", ChangesAsked("apply"))


def test_an_answer_is_returned_and_an_edge_that_does_not_run_has_none(monkeypatch):
    assert asked(monkeypatch, ChangesAnswer()) == ChangesAnswer()
    assert asked(monkeypatch, NotRunning("no edge is running here")) is None


def test_a_refusal_is_an_error_with_every_problem(monkeypatch):
    with pytest.raises(Refused, match="edge yard-1: it cannot be used; line 1; line 2"):
        asked(monkeypatch, ChangesAnswer(refusal="it cannot be used", problems=("line 1", "line 2")))


def test_silence_is_reported_with_the_version_of_the_edge(monkeypatch):
    with pytest.raises(TimedOut, match=r"it runs fleet 0\.1\.0; if that is older, restart it"):
        asked(monkeypatch, TimedOut("no answer"))
