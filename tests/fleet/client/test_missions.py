"""Missions of running edges: found, started in two steps, followed to their end, and controlled."""

import types

import pytest

from fleet.client import missions
from fleet.client.missions import (
    SILENT,
    MissionRun,
    edge_of,
    find_run,
    known_mission,
    mission_named,
    start_mission,
)
from fleet.errors import Refused, TimedOut
from fleet.missions.report import (
    Controlled,
    MissionState,
    PendingQuestion,
    RunControlRequest,
    RunState,
    Started,
)

MISSION = "version: 1\nroles: {eye: {}}\nsteps: [{id: rest, wait: 5}]\n"
YARD, BARN = types.SimpleNamespace(edge="yard"), types.SimpleNamespace(edge="barn")
ROBOTS = {"rex": [YARD], "ada": [BARN], "all": [YARD, BARN]}
EDGES = types.SimpleNamespace(named=ROBOTS.get, edges=lambda: [YARD])


def state(run="3f2a", **fields):
    return RunState(run, "yard", "patrol", "step", "up.1", fields.pop("started", 1000.0), **fields)


class Requests:
    """The edges, which answer what the test says; each request is noted."""

    def __init__(self):
        self.asked = []
        self.known = {"patrol": [MissionState("patrol", "yard")]}
        self.states = []
        self.refusal = ""
        self.answers = [
            Started("3f2a", {"eye": ["rex"], "spare eye": ["ada"]}),
            Started("3f2a", {"eye": ["rex"]}),
        ]

    def missions(self, _edges, name):
        return (
            [each for all_of in self.known.values() for each in all_of]
            if name == "*"
            else self.known.get(name, [])
        )

    def runs(self, _edges, run):
        if run == "*":
            return self.states
        return [found] if (found := self.states.pop(0)) is not None else []

    def start(self, _edges, edge, name, request):
        self.asked.append((edge, name, request))
        return self.answers.pop(0)

    def control(self, _edges, edge, run, request):
        self.asked.append((edge, run, request))
        return Controlled(self.refusal)


@pytest.fixture
def requests(monkeypatch):
    requests = Requests()
    for name in ("missions", "runs", "start", "control"):
        monkeypatch.setattr(missions.mission_requests, name, getattr(requests, name))
    monkeypatch.setattr(missions, "local_user", lambda: "anna")
    return requests


@pytest.fixture
def now(monkeypatch):
    """Let time pass only while a run is followed."""
    now = [1000.0]
    clock = types.SimpleNamespace(
        monotonic=lambda: now[0], sleep=lambda seconds: now.__setitem__(0, now[0] + seconds)
    )
    monkeypatch.setattr(missions, "time", clock)
    return now


@pytest.fixture
def run():
    return MissionRun(EDGES, state(), "yard", "anna")


def start(what="patrol", robots=None, **options):
    return start_mission(EDGES, what, inputs={"height": 5}, robots=robots or {}, **options)


def test_a_start_shows_its_robots_before_any_moves_and_starts_with_them(requests):
    shown = []
    run = start(filled=lambda roles: shown.append((dict(roles), len(requests.asked))))
    assert shown == [({"eye": ["rex"], "spare eye": ["ada"]}, 1)]
    (edge, name, first), (_, _, second) = requests.asked
    assert (edge, name, first.only_fill, second.only_fill) == ("yard", "patrol", True, False)
    assert first.run == second.run, "a repeat is the same run"
    assert (len(first.run), first.session_id, first.inputs, first.robots) == (8, "anna", {"height": 5}, {})
    assert second.robots == {"eye": ["rex"], "spare eye": ["ada"]}
    assert (run.id, run.edge, run.roles) == ("3f2a", "yard", {"eye": ["rex"], "spare eye": ["ada"]})


def test_who_sees_the_robots_may_prevent_the_start(requests):
    def no(_roles):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        start(filled=no)
    assert len(requests.asked) == 1


@pytest.mark.parametrize("step", [0, 1])
def test_a_refused_start_is_refused_with_its_hint(requests, step):
    requests.answers[step] = Started(refusal="rex: it is busy", hint="wait for it")
    with pytest.raises(Refused, match="rex: it is busy") as error:
        start()
    assert error.value.hint == "wait for it"


def test_a_file_is_sent_with_its_content_and_called_by_its_name(requests, tmp_path):
    file = tmp_path / "Night Patrol_2.yaml"
    file.write_text(MISSION)
    name, data = mission_named(str(file))
    assert (name, data["version"], list(data["roles"])) == ("night-patrol-2", 1, ["eye"])
    start(str(file), {"eye": ["rex"]})
    edge, name, first = requests.asked[0]
    assert (edge, name, first.mission, first.robots) == ("yard", "night-patrol-2", data, {"eye": ["rex"]})


@pytest.mark.parametrize("what", ["patrol", "patrol.txt", "a.b"])
def test_any_other_word_is_the_name_of_a_mission(what):
    assert mission_named(what) == (what, None)


@pytest.mark.parametrize(("content", "words"), [(None, "No such file"), ('{"x": 1}', "has|is")])
def test_a_plan_that_cannot_be_flown_is_refused_with_its_file(tmp_path, content, words):
    file = tmp_path / "field.plan"
    if content is not None:
        file.write_text(content)
    with pytest.raises(Refused, match=words) as error:
        mission_named(str(file))
    assert str(file) in str(error.value)


def test_a_mission_is_that_of_the_one_edge_that_has_it(requests):
    assert known_mission(EDGES, "patrol").edge == "yard"
    with pytest.raises(Refused, match="there is no mission 'petrol'") as error:
        known_mission(EDGES, "petrol")
    assert error.value.hint == "there are: patrol"
    requests.known["patrol"].append(MissionState("patrol", "barn"))
    with pytest.raises(Refused, match="several edges have a mission 'patrol'"):
        known_mission(EDGES, "patrol")


@pytest.mark.parametrize(
    ("robots", "edge"),
    [
        ({}, "yard"),
        ({"eye": ["rex"]}, "yard"),
        ({"eye": ["ada"]}, "barn"),
        ({"eye": ["rex", "ada"]}, ""),
        ({"eye": ["all"]}, ""),
    ],
)
def test_a_mission_that_is_sent_runs_where_its_robots_are(robots, edge):
    if edge:
        assert edge_of(EDGES, "patrol", robots, {}) == edge
        return
    with pytest.raises(Refused, match="several edges could run it: barn, yard"):
        edge_of(EDGES, "patrol", robots, {})


@pytest.mark.parametrize(
    ("run", "ended", "found"),
    [
        ("3f", False, "3f2a"),
        ("77", True, "77b0"),
        ("", False, "3f2a"),
        ("", True, "88c1"),
        ("77", False, "there is no run '77' under way"),
        ("99", True, "there is no run '99'"),
        ("7", True, "there are several: 77b0, 78d2"),
    ],
)
def test_a_run_is_found_by_the_beginning_of_its_id_or_the_newest(requests, run, ended, found):
    requests.states = [
        state(),
        state("77b0", outcome="failed", started=1.0),
        state("88c1", outcome="failed", started=2000.0),
        state("78d2", outcome="failed", started=2.0),
    ]
    if " " not in found:
        assert find_run(EDGES, run, ended=ended).run == found
        return
    with pytest.raises(Refused) as error:
        find_run(EDGES, run, ended=ended)
    assert error.value.reason == found


def test_a_run_is_followed_to_its_end(requests, now, run):
    last = state(outcome="completed")
    requests.states = [state(), None, state(), last, state("later")]
    assert [each.outcome for each in run.follow(every=2.0)] == ["", "", "completed"]
    assert now == [1006.0]
    requests.states = [state(), last]
    assert run.wait() is last


def test_an_edge_that_is_silent_for_a_while_may_be_restarting(requests, now, run):
    requests.states = [state(), *[None] * 100]
    with pytest.raises(TimedOut, match="run 3f2a: the edge does not answer; the outcome is unknown"):
        run.wait()
    assert SILENT < now[0] - 1000.0 <= SILENT + 1.0


@pytest.mark.parametrize("do", ["pause", "resume", "abort"])
def test_a_run_is_controlled_in_the_name_of_who_does_it(requests, run, do):
    getattr(run, do)()
    assert requests.asked == [("yard", "3f2a", RunControlRequest(do, session_id="anna"))]
    requests.refusal = "not possible while it is step"
    with pytest.raises(Refused, match="run 3f2a: not possible while it is step"):
        getattr(run, do)()


@pytest.mark.parametrize("goes_on", [True, False])
def test_its_present_question_is_answered(requests, run, goes_on):
    requests.states = [state(question=PendingQuestion(7, "Go on?", 30.0, "abort"))]
    run.answer(goes_on=goes_on)
    assert requests.asked[0][2] == RunControlRequest("answer", 7, goes_on, "anna")


def test_an_answer_to_nothing_is_left_to_the_edge_to_refuse(requests, run):
    requests.states, requests.refusal = [state()], "it asks nothing"
    with pytest.raises(Refused, match="it asks nothing"):
        run.answer(goes_on=True)
    assert requests.asked[0][2].question == 0
