"""Missions from a page: shown with their runs, started and controlled by the operator's name."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.missions.rehearsal import RehearsalNote, RehearsalResult, RehearsalState
from fleet.missions.report import Controlled, MissionState, PendingQuestion, RunRobot, RunState, Started
from fleet.model.permission import Permission

RUN = RunState(
    "3f2a",
    "yard-1",
    "patrol",
    "asking",
    "look",
    5.0,
    question=PendingQuestion(2, "Is the gate open?", 30.0, "abort"),
    robots=(RunRobot("rex", "feet", "goto"),),
)


class PlayedMissions:
    """The missions and the run of a played edge, and what it was asked for them."""

    def __init__(self, yard):
        self.requested = []
        self.answers = {"patrol": Started("3f2a", {"feet": ["rex"]}), "3f2a": Controlled()}
        self.rehearsal = []  # what is told of one, one after the other
        yard.bus.control.declare_queryable(
            "fleet/yard-1/missions/patrol", self._take, more=keys.SENDER_SUFFIX
        )
        yard.bus.control.declare_queryable("fleet/yard-1/runs/3f2a", self._take, more=keys.SENDER_SUFFIX)

    def _take(self, question):
        name = question.key.rpartition("/")[2]
        shown = {"patrol": MissionState("patrol", "yard-1", "Go round."), "3f2a": RUN}[name]
        if question.payload:
            self.requested.append(
                (name, msgspec.json.decode(question.payload), question.parameters.get("do"))
            )
            about_rehearsal = question.parameters.get("do") in {"rehearse", "rehearsal"}
            shown = self.rehearsal.pop(0) if about_rehearsal else self.answers[name]
        question.reply(msgspec.json.encode(shown))
        question.close()


@pytest.fixture(scope="module")
def missions(play_edge, console):
    missions = PlayedMissions(play_edge("yard-1", robots={"rex": {"health": "ok"}}))
    with console.page() as page:
        assert page.wait_for("missions", "yard-1/patrol")["summary"] == "Go round."
        assert page.wait_for("runs", "yard-1/3f2a")["question"]["text"] == "Is the gate open?"
    return missions


def test_missions_that_a_change_of_the_file_adds_and_removes_are_shown_so(serve_console, runtime, play_edge):
    yard = play_edge("other-1", robots={"rex": {"health": "ok"}})
    known = ["patrol", "sweep"]

    def take(question):
        for name in known:
            state = MissionState(name, "other-1")
            question.reply(msgspec.json.encode(state), keys.mission("other-1", name))
        question.close()

    yard.bus.control.declare_queryable(keys.mission("other-1", "*"), take, more=keys.SENDER_SUFFIX)
    with serve_console(runtime, "changes") as console:
        with console.page() as page:
            page.wait_for("missions", "other-1/sweep")
            known[:] = ["patrol", "mow"]
            page.wait_for("missions", "other-1/mow")
            page.wait_for("missions", "other-1/sweep", lambda entry: entry is None)
            assert page.entries["missions"]["other-1/patrol"]["name"] == "patrol"
        with console.page() as page:
            page.wait_for("missions", "other-1/mow")
            assert "other-1/sweep" not in page.entries["missions"]


def test_a_mission_is_started_by_the_operators_name(console, missions):
    with console.page(Permission.OPERATE) as page:
        page.request("mission", request="r", edge="yard-1", name="patrol", inputs={"height": 5})
        answer = page.answer("r")
    assert (answer["status"], answer["reason"]) == ("accepted", "run 3f2a with rex")
    name, requested, do = missions.requested[-1]
    assert (name, do, requested["inputs"], requested["session_id"]) == (
        "patrol",
        "start",
        {"height": 5},
        "anna",
    )
    assert requested["timestamp"] > 1e9


def test_a_question_is_answered(console, missions):
    with console.page() as page:
        page.request("run", request="r", edge="yard-1", run="3f2a", do="answer", question=2, goes_on=True)
        assert page.answer("r")["status"] == "accepted"
    assert missions.requested[-1][1] == {"do": "answer", "question": 2, "goes_on": True, "session_id": "anna"}


def test_what_the_edge_refuses_is_reported_with_its_reason_and_hint(console, missions, monkeypatch):
    monkeypatch.setitem(missions.answers, "patrol", Started(refusal="rex is stopped", hint="release it"))
    with console.page() as page:
        page.request("mission", request="r", edge="yard-1", name="patrol")
        answer = page.answer("r")
    assert (answer["status"], answer["reason"], answer["hint"]) == (
        "rejected",
        "rex is stopped",
        "release it",
    )


def test_a_run_that_nobody_knows_is_reported(console, missions):
    with console.page() as page:
        page.request("run", request="r", edge="yard-1", run="none", do="abort")
        assert page.answer("r")["reason"] == "no edge answers on fleet/yard-1/runs/none"


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("mission", {"name": "patrol"}),
        ("rehearse", {"name": "patrol"}),
        ("run", {"run": "3f2a", "do": "abort"}),
    ],
)
def test_who_may_only_view_starts_and_aborts_nothing(console, missions, kind, fields):
    before = len(missions.requested)
    with console.page(Permission.VIEW) as page:
        page.request(kind, **fields, request="r", edge="yard-1")
        assert "it needs the permission operate" in page.answer("r")["reason"]
    assert len(missions.requested) == before


NOTES = RehearsalNote(0.5, "it begins"), RehearsalNote(1.0, "rex is there")


def test_a_rehearsal_is_followed_to_its_result(console, missions):
    result = RehearsalResult("patrol", "completed", 12.0)
    missions.rehearsal = [
        RehearsalState("7", roles={"feet": ["rex"]}),
        RehearsalState("7", seconds=1.0, step="go", notes=NOTES),
        RehearsalState("7", seconds=12.0, result=result),
    ]
    with console.page(Permission.OPERATE) as page:
        page.request("rehearse", request="r", edge="yard-1", name="patrol", inputs={"height": 5})
        while not (answer := page.next("answer")).get("done"):
            pass
    assert answer["rehearsal"]["result"]["seconds"] == 12.0
    rehearsals = [each["rehearsal"] for each in page.answers if each["request"] == "r"]
    assert [each.get("step", "") for each in rehearsals] == ["", "go", ""]
    (_, begun, first), (_, looked, second), (_, again, third) = missions.requested[-3:]
    assert (first, second, third) == ("rehearse", "rehearsal", "rehearsal")
    assert (begun["inputs"], begun["session_id"]) == ({"height": 5}, "anna")
    assert (looked, again) == ({"id": "7", "since": 0}, {"id": "7", "since": 2})


@pytest.mark.parametrize(
    "states",
    [
        [RehearsalState(refusal="another rehearsal is under way")],
        [RehearsalState("7"), RehearsalState("7", failure="another rehearsal is under way")],
    ],
    ids=["refused", "failed"],
)
def test_a_rehearsal_that_there_cannot_be_is_reported_with_its_reason(console, missions, states):
    missions.rehearsal = list(states)
    with console.page(Permission.OPERATE) as page:
        page.request("rehearse", request="r", edge="yard-1", name="patrol")
        while (answer := page.next("answer"))["status"] == "accepted":
            pass
    assert (answer["status"], answer["reason"]) == (
        "rejected",
        "it cannot be rehearsed: another rehearsal is under way",
    )
