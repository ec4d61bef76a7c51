"""A changed drop-in file is loaded by the workers of its robots, and who asks sees them come back."""

import contextlib
from types import SimpleNamespace

import pytest

from fleet.cli import adapters_reload
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState

OK = Reply("reload", ReplyStatus.ACCEPTED)
ALL = ("rex", "max", "arm")


def robot(name, worker="w", *, adapter="toy", drop_in="toy.py", reachable=True):
    return RobotState(name, "t", adapter, "yard", 1.0, worker=worker, drop_in=drop_in, reachable=reachable)


class Edges(contextlib.AbstractContextManager):
    """Edges whose states are those of the next look, and the last one from then on."""

    def __init__(self, *looks, answers=None):
        self.looks, self.answers, self.asked = list(looks), answers or {}, []

    def reach(self, _file):
        return self

    def __exit__(self, *_):
        pass

    def states(self):
        return self.looks.pop(0) if len(self.looks) > 1 else self.looks[0]

    def reload(self, edge, worker, name, *, within):
        self.asked.append((edge, worker, name, within))
        return self.answers.get(worker, OK)


@pytest.fixture
def reload(fleet, monkeypatch):
    """Reload the adapter toy at the given edges, in time that only sleeps pass."""
    now = [0.0]

    def sleep(seconds):
        now[0] += seconds

    monkeypatch.setattr(adapters_reload, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))

    def reload(edges, *arguments, name="toy"):
        monkeypatch.setattr(adapters_reload, "Edges", edges)
        return fleet("adapters", "reload", name, *arguments)

    yield reload
    assert now[0] < 100.0


def looks(*robots, away=1):
    """Return the states of robots before, while some looks find them away, and afterwards."""
    gone = [robot(each.name, each.worker, reachable=False) for each in robots]
    return [list(robots), *[gone] * away, list(robots)]


@pytest.mark.parametrize("away", [1, 20])
def test_robots_that_were_away_and_are_back_run_with_the_new_file(reload, away):
    edges = Edges(*looks(robot("rex"), robot("max"), away=away))
    result = reload(edges)
    assert (result.code, result.err) == (0, "")
    assert result.out == "worker w: reloaded; running again: rex, max\n"
    assert edges.asked == [("yard", "w", "toy", adapters_reload._ANSWER_WITHIN)]


def test_each_worker_is_asked_once_and_all_are_told_to_programs(reload):
    one, other = robot("rex", "v"), robot("max", "w")
    edges = Edges([one, other], [], [one], [], [other])
    result = reload(edges, "--json")
    assert (result.code, result.json) == (0, {"reloaded": ["v", "w"]})
    assert [worker for _, worker, _, _ in edges.asked] == ["v", "w"]


def test_robots_that_never_went_away_are_not_taken_for_reloaded(reload):
    result = reload(Edges([robot("rex")]))
    assert (result.code, result.out) == (5, "")
    assert result.err == "worker w: was started again, and its robots do not answer yet: see fleet ps\n"


def test_a_robot_that_does_not_come_back_is_reported(reload):
    back = [robot("rex"), robot("max", reachable=False)]
    result = reload(Edges([robot("rex"), robot("max")], [], back))
    assert (result.code, "its robots do not answer yet" in result.err) == (5, True)


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (Reply("reload", ReplyStatus.REJECTED, "rex is commanded"), "rex is commanded"),
        (None, "it does not answer"),
    ],
)
def test_a_worker_that_does_not_reload_is_told_with_the_reason(reload, answer, why):
    class Refuses(Edges):
        def reload(self, *_arguments, within):
            return answer

    result = reload(Refuses([robot("rex")]))
    assert (result.code, result.err) == (5, f"worker w: not reloaded: {why}\n")


def test_one_of_two_workers_is_a_part(reload):
    refusal = Reply("reload", ReplyStatus.REJECTED, "max is armed")
    edges = Edges(*looks(robot("rex", "v"), robot("max", "w")), answers={"w": refusal})
    result = reload(edges)
    assert (result.code, result.err) == (7, "worker w: not reloaded: max is armed\n")


FIXED = [{"worker": ""}, {"drop_in": ""}]


@pytest.mark.parametrize("fields", FIXED)
def test_a_robot_without_a_drop_in_file_in_a_worker_needs_a_restart_of_the_edge(reload, fields):
    edges = Edges([robot("rex", **fields)])
    result = reload(edges)
    assert (result.code, edges.asked) == (5, [])
    assert result.err.startswith("rex: no drop-in file in a worker runs it; end fleet run")


def test_beside_such_a_robot_the_others_are_reloaded(reload):
    fixed = robot("arm", "")
    edges = Edges([robot("rex"), fixed], [fixed], [robot("rex"), fixed])
    result = reload(edges)
    assert (result.code, result.out) == (7, "worker w: reloaded; running again: rex\n")
    assert result.err.startswith("arm: no drop-in file")


@pytest.mark.parametrize(
    ("name", "states", "hint"),
    [
        ("toi", [robot("rex")], "did you mean 'toy'?"),
        ("xyz", [robot("rex"), robot("max", adapter="ugv")], "those of running robots are toy, ugv"),
        ("toy", [], "those of running robots are none"),
    ],
)
def test_an_adapter_that_no_robot_has_is_answered_with_what_there_is(reload, name, states, hint):
    result = reload(Edges(states), name=name)
    assert result.code == 5
    assert result.err == f"fleet: no running robot has the adapter {name!r} ({hint})\n"
