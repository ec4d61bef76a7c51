"""What people and programs see of the changes of a fleet file, and the exit code of all together."""

import functools
import queue
from pathlib import Path
from types import SimpleNamespace

import pytest

from fleet.cli import changes as module
from fleet.cli.changes import SOON, TAKES, _report_waiting, line_of
from fleet.config.difference import outline_of
from fleet.config.load import load
from fleet.host.edge.last_configuration import keep
from fleet.model.change import Change, ChangeKind, ChangesAnswer, Outcome
from fleet.spool.state_folder import state_folder

REBUILT, SETTINGS, SAME = ChangeKind.REBUILT, ChangeKind.SETTINGS, ChangeKind.UNTOUCHED


FLEET = """
edge: {id: yard-1}
robots: [{name: rex, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: ugv, profile: waveshare-beast,
  link: "sim:waveshare-beast"}]
"""


@functools.cache
def loaded_once(_text):
    return load("fleet.yaml")


@pytest.fixture
def edge(monkeypatch, place):
    """Play an edge that answers ``edge.changes``; None: it does not run."""
    (place / "fleet.yaml").write_text(FLEET)
    edge = SimpleNamespace(changes=None, requests=[])

    def request(name, file, requested):
        edge.requests.append((name, file, requested))
        return None if edge.changes is None else ChangesAnswer(tuple(edge.changes))

    monkeypatch.setattr(module, "request_changes", request)
    monkeypatch.setattr(module, "load", lambda file: loaded_once(Path(file).read_text()))
    return edge


LINES = [
    (Change("rex", ChangeKind.ADDED), "rex: added"),
    (Change("rex", REBUILT, ("a: 1 -> 2", "b")), "rex: rebuilt because of a: 1 -> 2; b"),
    (Change("rex", REBUILT, outcome=Outcome.DONE), "rex: rebuilt [done]"),
    (Change("rex", REBUILT, why="it is armed"), "rex: rebuilt [refused now: it is armed]"),
    (Change("bus", ChangeKind.RESTART, why="it is fixed"), "bus: restart [needs one: it is fixed]"),
    (Change("rex", REBUILT, ("a",), "x", Outcome.REFUSED), "rex: rebuilt because of a [refused: x]"),
    (Change("rex", SETTINGS, (), "it waits", Outcome.PARTLY), "rex: settings only [partly done: it waits]"),
    (Change("rex", REBUILT, (), "no answer", Outcome.FAILED), "rex: rebuilt [failed: no answer]"),
]


@pytest.mark.parametrize(("change", "line"), LINES)
def test_a_change_is_one_line_with_its_fields_and_what_came_of_it(change, line):
    assert line_of(change) == line


def test_untouched_robots_are_one_line_at_the_end(fleet, edge):
    edge.changes = [Change("rex", SAME), Change("max", REBUILT), Change("arm", SAME)]
    result = fleet("diff")
    assert (result.code, result.out) == (7, "max: rebuilt\nuntouched: 2 robots: rex, arm\n")
    (name, file, requested) = edge.requests[0]
    assert (name, file, requested.do, requested.force) == ("yard-1", "fleet.yaml", "diff", False)
    assert requested.file.endswith("/fleet.yaml")
    assert requested.file.startswith("/")


@pytest.mark.parametrize(("changes", "code"), [([], 0), ([Change("rex", SAME)], 0), ([LINES[0][0]], 7)])
def test_a_difference_is_an_exit_code(fleet, edge, changes, code):
    edge.changes = changes
    assert fleet("diff").code == code


def test_programs_get_each_change(fleet, edge):
    edge.changes = [Change("rex", SAME), Change("max", REBUILT, ("a",))]
    assert fleet("diff", "--json").json == [
        {"name": "rex", "kind": "untouched"},
        {"name": "max", "kind": "rebuilt", "fields": ["a"]},
    ]


DONE, PARTLY, REFUSED, FAILED = (
    Change("rex", REBUILT, outcome=outcome)
    for outcome in (Outcome.DONE, Outcome.PARTLY, Outcome.REFUSED, Outcome.FAILED)
)
CODES = [
    ([], 0),
    ([Change("rex", SAME)], 0),
    ([DONE, Change("max", SAME, outcome=Outcome.REFUSED)], 0),
    ([DONE, REFUSED], 7),
    ([DONE, FAILED], 7),
    ([PARTLY], 7),
    ([PARTLY, REFUSED], 7),
    ([REFUSED], 5),
    ([FAILED, REFUSED, Change("max", SAME)], 5),
]


@pytest.mark.parametrize(("changes", "code"), CODES)
def test_the_exit_code_says_whether_all_or_a_part_or_nothing_is_applied(fleet, edge, changes, code):
    edge.changes = changes
    assert fleet("apply").code == code


@pytest.mark.parametrize(("arguments", "force"), [((), False), (("--force",), True)])
def test_apply_says_who_asks_and_with_what_force(fleet, edge, monkeypatch, arguments, force):
    monkeypatch.setattr(module, "local_user", lambda: "anna@desk")
    edge.changes = []
    fleet("apply", *arguments)
    ((_, _, requested),) = edge.requests
    assert (requested.do, requested.force, requested.by) == ("apply", force, "anna@desk")


def test_apply_needs_a_running_edge(fleet, edge):
    result = fleet("apply")
    assert result.code == 4
    assert "edge yard-1 does not run; fleet run fleet.yaml starts it with this file" in result.err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("fleet.yaml", "other.yaml"), "one fleet file at a time; several bundles need --fleet"),
        (("--fleet", "--force", "x"), "--force is for one edge"),
    ],
)
def test_arguments_that_contradict_each_other_ask_nobody(fleet, edge, arguments, why):
    result = fleet("apply", *arguments)
    assert (result.code, edge.requests) == (2, [])
    assert why in " ".join(result.err.split())


def test_a_stopped_edge_is_compared_with_what_it_last_ran_with(fleet, edge, place):
    loaded = load(place / "fleet.yaml")
    keep(state_folder("yard-1", loaded.config.edge.spool.path), outline_of(loaded), 1000.0)
    result = fleet("diff")
    assert (result.code, result.out) == (0, "untouched: 1 robot: rex\n")
    assert "edge yard-1 does not run; compared with what it last ran with, since 1970-" in result.err
    (place / "fleet.yaml").write_text(FLEET.replace("name: rex,", "name: rex, limits: {speed: 0.5},"))
    result = fleet("diff")
    assert result.code == 7
    assert result.out.endswith(" because of limits.speed\n"), "the values are not known"


def test_an_edge_that_never_ran_has_nothing_to_compare_with(fleet, edge, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    result = fleet("diff")
    assert result.code == 4
    assert "edge yard-1 does not run, and has left nothing to compare with" in result.err


def test_who_waits_for_an_edge_sees_that(monkeypatch):
    monkeypatch.setattr(module, "SOON", 0.01)
    notes = queue.Queue()
    with _report_waiting(SimpleNamespace(note=notes.put), "yard-1"):
        assert notes.get(timeout=20) == f"waiting for edge yard-1: {TAKES}"


def test_an_edge_that_answers_soon_is_not_waited_for(monkeypatch):
    timers = []

    class Timer:
        def __init__(self, seconds, call, arguments):
            self.seconds, self.states = seconds, []
            timers.append(self)

        def start(self):
            self.states.append("started")

        def cancel(self):
            self.states.append("cancelled")

    monkeypatch.setattr(module.threading, "Timer", Timer)
    with _report_waiting(SimpleNamespace(note=None), "yard-1"):
        pass
    ((timer),) = timers
    assert (timer.seconds, timer.states) == (SOON, ["started", "cancelled"])
