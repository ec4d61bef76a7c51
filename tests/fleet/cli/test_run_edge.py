"""The edge itself: it says what it leaves out, and refuses to guess which edge of a pair it is."""

import logging
from types import SimpleNamespace

import pytest

from fleet.cli import run_edge as module
from fleet.cli.output import ExitCode
from fleet.config.edge_id import EDGE_ID


class Edge:
    def __init__(self):
        self.watched = 0

    def watch_drop_ins(self):
        self.watched += 1


@pytest.fixture
def run(fleet, monkeypatch):
    """Return a function that runs an edge of a file; it returns the result, and what is served."""
    served = []

    def serve(loaded, out, **given):
        edge = Edge()
        given["started"](edge)
        served.append((loaded, out, edge, given))
        return ExitCode.SOME_FAILED

    monkeypatch.setattr(module, "serve", serve)
    monkeypatch.setattr(module, "connect_supervisor", lambda: "the supervisor")
    monkeypatch.delenv(EDGE_ID, raising=False)

    def run(*arguments, pair=None, problems=(), warnings=()):
        config = SimpleNamespace(pair=pair, edge=SimpleNamespace(id="yard"))
        loaded = SimpleNamespace(config=config, problems=problems, warnings=warnings)
        monkeypatch.setattr(module, "load", lambda file, *, partial: loaded if partial else None)
        return fleet("run-edge", "fleet.yaml", *arguments), served

    return run


def test_an_edge_is_served_with_its_supervisor_and_says_how_to_see_it(run):
    result, ((_, _, edge, given),) = run()
    assert (result.code, result.err) == (7, "edge yard runs; see it with: fleet ps\n")
    assert (given["supervised"], edge.watched) == ("the supervisor", 0)


def test_files_of_drop_ins_are_watched_only_if_asked(run):
    _, ((_, _, edge, _),) = run("--watch")
    assert edge.watched == 1


def test_what_cannot_run_is_told_and_the_rest_is_served(run):
    result, served = run(problems=("rex: no port", "max: no port"), warnings=("tom: no battery",))
    assert result.err.splitlines()[:3] == [
        "left out: rex: no port",
        "left out: max: no port",
        "warning: tom: no battery",
    ]
    assert len(served) == 1


@pytest.mark.parametrize(
    ("arguments", "level", "form"),
    [((), logging.WARNING, "text"), (("-v", "--log-format", "json"), logging.INFO, "json")],
)
def test_it_logs_as_it_was_asked_to(run, arguments, level, form):
    _, ((_, _, _, given),) = run(*arguments)
    assert (given["logs"].level, given["logs"].form) == (level, form)


@pytest.mark.parametrize("known", ["", None])
def test_an_edge_of_a_pair_that_does_not_know_which_it_is_does_not_run(run, monkeypatch, known):
    if known is not None:
        monkeypatch.setenv(EDGE_ID, known)
    result, served = run(pair=("yard-a", "yard-b"))
    assert (result.code, served) == (3, [])
    assert "fleet.yaml is for a pair of edges" in result.err
    assert "fleet run --edge-id yard-a or yard-b says which one this is" in result.err


def test_an_edge_of_a_pair_that_knows_which_it_is_runs(run, monkeypatch):
    monkeypatch.setenv(EDGE_ID, "yard-a")
    _, served = run(pair=("yard-a", "yard-b"))
    assert len(served) == 1
