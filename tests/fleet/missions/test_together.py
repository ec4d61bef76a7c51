"""A run whose robots begin together: prepared first, recorded, and only then told the instant."""

import pytest

from fleet.missions.program import Act
from fleet.missions.report import RunControlRequest
from fleet.missions.state import NotStarted, PartOutcome, Phase, RobotPrepared, StepPart
from fleet.missions.store import RunStore
from fleet.missions.together import TogetherStep
from fleet.model.command import Reply, ReplyStatus, Transport

TOGETHER = {
    "version": 1,
    "roles": {"eye": {"from": "kestrel"}, "feet": {"from": "beast"}},
    "steps": [
        {"id": "go", "start": "together", "do": {"all": {"goto": [1, 2]}}},
        {"id": "on", "start": "together", "do": {"all": {"goto": [3, 4]}}},
    ],
}


def test_all_are_prepared_recorded_and_then_begin_at_one_instant(yard):
    yard.start(TOGETHER)
    (start,) = yard.starts
    assert sorted(start.robots) == ["beast", "kestrel"]
    assert yard.robots["kestrel"].names == yard.robots["beast"].names == [], "nobody moves before"
    (kept,) = RunStore(yard.folder).unfinished()
    assert sorted(part.identity for part in kept.parts) == ["3f2a/go.1/beast/1", "3f2a/go.1/kestrel/1"]
    start.instant()
    for robot in ("kestrel", "beast"):
        assert yard.robots[robot].names == ["goto"]
        yard.done(robot, "goto")
    assert len(yard.starts) == 2, "each step is a start of its own"
    yard.starts[1].instant()
    yard.done("kestrel", "goto")
    yard.done("beast", "goto")
    assert yard.last.outcome == "completed"


def test_one_that_cannot_be_prepared_keeps_everybody_standing(yard):
    yard.robots["beast"].refuses["goto"] = "the goal is outside its fence"
    yard.start(TOGETHER)
    assert yard.starts[0].withdrawn
    assert yard.starts[0].robots == []
    assert "beast cannot: the goal is outside its fence; no robot moved" in yard.last.reason or (
        yard.last.phase == "ending"
    )
    for robot in ("kestrel", "beast"):
        yard.done(robot, "stop")
    assert (yard.last.outcome, yard.last.reason) == (
        "failed",
        "step go.1: beast cannot: the goal is outside its fence; no robot moved",
    )


def test_when_the_instant_is_not_taken_nobody_moves_and_nothing_is_undone(yard):
    steps = [{**TOGETHER["steps"][0], "undo": {"all": "land"}}]
    yard.start({**TOGETHER, "steps": steps, "on_failure": "undo"})
    yard.starts[0].fail("beast: its process did not take the instant in time")
    yard.settle()
    for robot in ("kestrel", "beast"):
        yard.done(robot, "stop")
    assert yard.last.outcome == "undone"
    assert "did not take the instant in time; no robot moved" in yard.last.reason
    assert yard.robots["kestrel"].names == ["stop"], "there is nothing to undo"


def test_an_abort_before_the_instant_takes_the_start_back(yard):
    yard.start(TOGETHER)
    yard.control("3f2a", RunControlRequest("abort"))
    yard.settle()
    assert yard.starts[0].withdrawn


def test_a_pause_before_all_have_begun_is_refused_in_words_and_changes_nothing(yard):
    yard.start(TOGETHER)
    for _ in range(2):
        why = yard.control("3f2a", RunControlRequest("pause"))
        yard.turn()
        assert why == "its robots are about to begin together: pause it once they have, or abort it now"
    (start,) = yard.starts
    assert not start.withdrawn
    start.instant()
    answers = yard.controlled("3f2a", RunControlRequest("pause"))
    assert yard.last.phase == "paused"
    assert answers == []
    for robot in ("kestrel", "beast"):
        yard.done(robot, "pause")
    assert answers == [""], "once all hold"
    for robot in ("kestrel", "beast"):
        assert yard.robots[robot].names == ["goto", "pause"], "each holds what it has begun"


def test_while_robots_are_asked_whether_they_could_a_pause_is_refused(yard):
    yard.start(TOGETHER, settles=False)
    yard.store._thread.submit(lambda: None).result(20)
    while yard.soon and not yard.starts:
        yard.soon.pop(0)()
    assert yard.control("3f2a", RunControlRequest("pause")).startswith(
        "its robots are about to begin together"
    )


def test_one_that_is_lost_before_it_has_begun_keeps_nobody_from_pausing_the_others(yard):
    yard.start({**TOGETHER, "quorum": {"eye": 1, "feet": 0}})
    yard.starts[0].robots.remove("beast")
    yard.starts[0].instant()
    assert yard.control("3f2a", RunControlRequest("pause"))
    yard.robots["beast"].be(reachable=False, cause="its link fell")
    yard.turn()
    yard.controlled("3f2a", RunControlRequest("pause"))
    assert yard.last.phase == "paused"


ACT = Act("goto", [1, 2])
ROBOTS = ("kestrel", "beast")


class Common:
    """A common start that only notes what it is asked for."""

    def __init__(self):
        self.heard = {}
        self.begun = []
        self.withdrawn = 0
        self.asked = []

    def prepare(self, robot, kind, payload, *, transport, identity, heard):
        self.asked.append((robot, kind, payload, transport, identity))
        self.heard[robot] = heard

    def begin(self, robots, failed):
        self.begun.append(robots)
        self.fail = failed

    def withdraw(self):
        self.withdrawn += 1


class Step:
    """Steps of robots that begin together, without a run around them."""

    def __init__(self):
        self.starts, self.events, self.replies = [], [], []
        self.together = TogetherStep(
            self._new,
            Transport.CLOUD,
            payload=lambda message: message["command"].encode(),
            handle=self.events.append,
            replied=lambda identity, reply: self.replies.append((identity, reply)),
        )

    def _new(self):
        self.starts.append(Common())
        return self.starts[-1]

    def prepare(self, step="go.1"):
        for robot in ROBOTS:
            self.together.prepare(robot, "navigate", {"command": "goto"}, f"run/{step}/{robot}/1")
        return self.starts[-1]

    def parts(self, step="go.1"):
        return tuple(
            StepPart(f"run/{step}/{robot}/1", step, robot, "all", 1, "do", ACT, 0.0, 60.0) for robot in ROBOTS
        )

    def begin(self, step="go.1"):
        parts = self.parts(step)
        self.together.begin(step, parts)
        return parts


@pytest.fixture
def step():
    return Step()


def accepted(**fields):
    return Reply("goto", ReplyStatus.ACCEPTED, **fields)


def test_the_robots_of_a_step_are_prepared_in_one_start(step):
    start = step.prepare()
    assert step.starts == [start]
    assert start.asked == [
        (robot, "navigate", b"goto", Transport.CLOUD, f"run/go.1/{robot}/1") for robot in ROBOTS
    ]
    assert step.prepare("on.2") is not start
    assert len(step.starts) == 2


@pytest.mark.parametrize(
    ("reply", "refusal"),
    [
        (accepted(), ""),
        (Reply("goto", ReplyStatus.DENIED, "it has a fault"), "it has a fault"),
        (Reply("goto", ReplyStatus.TIMEOUT), "it refused"),
    ],
)
def test_the_first_answer_says_whether_a_robot_can_and_the_next_how_it_went(step, reply, refusal):
    start = step.prepare()
    start.heard["beast"](reply)
    assert (step.events, step.replies) == ([RobotPrepared("beast", refusal)], [])
    start.heard["beast"](accepted(done=True))
    assert step.events == [RobotPrepared("beast", refusal)]
    assert step.replies == [("run/go.1/beast/1", accepted(done=True))]


def test_those_prepared_are_told_to_begin_and_a_failure_is_that_of_the_step(step):
    start = step.prepare()
    step.begin()
    assert start.begun == [list(ROBOTS)]
    start.fail("beast: it was late")
    assert step.events == [NotStarted("go.1", "beast: it was late")]
    assert step.together.unpausable(Phase.STEP) == ""


def test_nobody_begins_when_one_of_them_has_left_meanwhile(step):
    start = step.prepare()
    parts = step.parts()
    parts[1].outcome = PartOutcome.LOST
    step.together.begin("go.1", parts)
    assert (start.begun, start.withdrawn) == ([], 1)
    assert step.events == [NotStarted("go.1", "a robot left the run meanwhile")]


def test_nobody_begins_who_was_not_prepared_by_this_process(step):
    step.begin()
    assert step.events == [NotStarted("go.1", "a robot left the run meanwhile")]


@pytest.mark.parametrize("phase", list(Phase))
def test_a_run_may_be_paused_unless_its_robots_prepare(step, phase):
    assert bool(step.together.unpausable(phase)) is (phase is Phase.PREPARING)


def test_a_run_may_be_paused_once_each_robot_has_begun_or_is_given_up(step):
    start = step.prepare()
    parts = step.begin()
    for robot in ROBOTS:
        start.heard[robot](accepted())
    assert step.together.unpausable(Phase.STEP)
    start.heard["kestrel"](accepted())
    assert step.together.unpausable(Phase.STEP) == (
        "its robots are about to begin together: pause it once they have, or abort it now"
    )
    parts[1].outcome = PartOutcome.LOST
    assert step.together.unpausable(Phase.STEP) == ""


@pytest.mark.parametrize("phase", list(Phase))
def test_a_run_that_leaves_the_step_takes_the_start_back_once(step, phase):
    start = step.prepare()
    for _ in range(2):
        step.together.follow(phase)
    stays = phase in (Phase.PREPARING, Phase.STEP)
    assert start.withdrawn == (0 if stays else 1)
    step.begin()
    assert (start.begun != []) is stays


def test_a_start_that_was_taken_back_keeps_nobody_from_pausing(step):
    step.prepare()
    step.begin()
    assert step.together.unpausable(Phase.STEP)
    step.together.withdraw()
    assert step.together.unpausable(Phase.STEP) == ""
