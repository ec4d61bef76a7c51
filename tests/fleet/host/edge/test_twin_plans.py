"""``mission/command`` of the cloud: a twin's plan is a run, which the cloud controls and hears of."""

import json
import time

import pytest

from fleet.host.edge.twin_plans import STATES, status_of
from fleet.missions.report import PendingQuestion, RunState
from fleet.missions.state import PartOutcome, Replied, RunOutcome
from fleet.model.command import Transport
from fleet.model.navigation import ActionState
from fleet.model.report import NavigationReport
from fleet.wire.databus import encode_report
from fleet.wire.reports import sender, to_mqtt

HERE = {"worker": "main"}
RUN = "6f0c9a1e-0000-4000-8000-00000000aaaa"
STEPS = [{"type": "waypoint", "params": {"latitude": 47.4, "longitude": 8.5, "altitude_m": 5}}]
START = {"command": "start", "mission_execution_uuid": RUN, "steps": STEPS}


class Cloud:
    """What the cloud says to one robot, and hears of it on ``mission/status``."""

    def __init__(self, edge, robot):
        self.edge, self.runs = edge, edge.missions.runs
        self.robot = edge.process.robots[robot]
        self.statuses = []
        tell = edge.process.outbox.navigates
        edge.process.outbox.navigates = lambda report: (self._hear(report), tell(report))

    def _hear(self, report):
        by = sender(source_type="edge", session="s")
        for suffix, payload in to_mqtt(report, by):
            assert suffix == "mission/status"
            self.statuses.append(json.loads(payload))

    def say(self, message, **fields):
        """Send a message; the answers fill the list that is returned."""
        sent = {"source_type": "tele", "session_id": "anna", "timestamp": time.time(), **message, **fields}
        port = self.edge.missions.plans.port(self.robot)
        answers = []
        requested = port.read("mission", json.dumps(sent).encode(), transport=Transport.CLOUD)
        requested(answers.append)
        return answers

    def reported(self):
        """Return the statuses of the run, without repeats of the same."""
        words = [(each["status"], each["message"]) for each in self.statuses]
        assert {each["mission_execution_uuid"] for each in self.statuses} <= {RUN}
        return list(dict.fromkeys(words))

    @property
    def terminal(self):
        return [status for status, _ in self.reported() if status in ("completed", "failed", "cancelled")]

    def run(self):
        return self.runs.find(RUN)


@pytest.fixture
async def cloud(yard, run_edge, requests):
    """Run an edge with a robot that the cloud may lead."""
    place = yard(rex=HERE)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok")
        cloud = Cloud(edge, "rex")
        cloud.words = lambda: place.words("rex")
        yield cloud


async def flies(cloud, requests):
    """Start the plan, and wait until the robot flies it."""
    answers = cloud.say(START)
    await requests.until(lambda: "navigate" in cloud.words() and answers)
    assert answers[0].ok, answers
    return cloud.run()


async def test_a_plan_of_the_cloud_is_a_run_that_carries_its_authority(cloud, requests):
    run = await flies(cloud, requests)
    assert (run.about.transport, run.about.source_type, run.about.by) == ("cloud", "tele", "anna")
    (part,) = run.engine.robots.active()
    await requests.until(lambda: ("running", "") in cloud.reported())
    assert cloud.robot.state().run == RUN
    run.handle(Replied(part.identity, PartOutcome.DONE, ""))
    await requests.until(lambda: cloud.terminal)
    steps = [(each["status"], each["current_step"]) for each in cloud.statuses]
    assert steps[0] == ("queued", 0)
    assert cloud.reported()[-1] == ("completed", "completed")
    assert cloud.terminal == ["completed"]


async def test_a_repeat_is_the_same_run_also_after_its_end(cloud, requests):
    run = await flies(cloud, requests)
    again = cloud.say(START)
    await requests.until(lambda: again)
    assert again[0].ok
    assert cloud.run() is run
    (part,) = run.engine.robots.active()
    run.handle(Replied(part.identity, PartOutcome.DONE, ""))
    await requests.until(lambda: cloud.terminal)
    before = len(cloud.statuses)
    late = cloud.say(START)
    await requests.until(lambda: len(cloud.statuses) > before)
    assert late[0].ok
    assert cloud.run() is None
    assert cloud.reported()[-1] == ("completed", "completed")
    assert cloud.words().count("navigate") == 1


async def test_pause_and_resume_are_the_runs(cloud, requests):
    run = await flies(cloud, requests)
    answers = cloud.say({"command": "pause", "mission_execution_uuid": RUN})
    await requests.until(lambda: "stop" in cloud.words() and answers)
    assert answers[0].ok
    assert run.engine.head.phase == "paused"
    assert cloud.reported()[-1] == ("running", "paused")
    late = cloud.say({"command": "resume"}, timestamp=time.time() - 60)
    await requests.until(lambda: late)
    assert not late[0].ok
    assert "60.0 s old" in late[0].reason
    stranger = cloud.say({"command": "resume"}, source_type="edit")
    await requests.until(lambda: stranger)
    assert "'edit'" in stranger[0].reason
    answers = cloud.say({"command": "resume"})
    await requests.until(lambda: cloud.words().count("navigate") == 2 and answers)
    assert answers[0].ok
    assert run.engine.head.phase == "step"


async def test_cancel_stops_the_robot_at_once_and_the_run_is_cancelled(cloud, requests):
    await flies(cloud, requests)
    answers = cloud.say({"command": "cancel"}, source_type="edit")
    await requests.until(lambda: "stop" in cloud.words() and cloud.terminal and answers)
    assert answers[0].ok
    assert cloud.terminal == ["cancelled"]
    assert cloud.reported()[-1] == ("cancelled", "aborted: aborted by anna")
    await requests.until(lambda: not cloud.robot.state().run)


async def test_what_the_robot_would_not_obey_starts_no_run(cloud, requests):
    refusals = [
        ({"source_type": "edit"}, "source_type 'edit'"),
        ({"source_type": None}, "no source_type"),
        ({"timestamp": 1.0}, "s old"),
        ({"mission_execution_uuid": "a/b"}, "cannot be the id of a run"),
        ({"steps": [{"type": "waypoint"}]}, "latitude"),
    ]
    for fields, why in refusals:
        cloud.statuses.clear()
        answers = cloud.say(START, **fields)
        await requests.until(lambda answers=answers: answers and cloud.statuses)
        assert not answers[0].ok
        assert why in answers[0].reason
        (status,) = cloud.statuses
        assert (status["status"], why in status["message"]) == ("failed", True)
    assert cloud.runs.all() == []
    assert cloud.words() == ["run"]


async def test_a_start_from_before_somebodys_stop_starts_no_run(cloud, requests):
    requested = time.time() - 0.05
    stop = cloud.robot.read("command", b'{"command": "stop"}', transport=Transport.CLOUD)
    stop(lambda _: None)
    answers = cloud.say(START, timestamp=requested)
    await requests.until(lambda: answers)
    assert not answers[0].ok
    assert "stop" in answers[0].reason
    assert "navigate" not in cloud.words()


async def test_a_robot_that_a_run_has_flies_no_other_plan(cloud, requests):
    await flies(cloud, requests)
    other = RUN.replace("aaaa", "bbbb")
    answers = []
    payload = {**START, "mission_execution_uuid": other, "source_type": "tele", "timestamp": time.time()}
    port = cloud.edge.missions.plans.port(cloud.robot)
    cloud.edge.process.outbox.navigates = lambda _: None
    port.read("mission", json.dumps(payload).encode(), transport=Transport.CLOUD)(answers.append)
    await requests.until(lambda: answers)
    assert f"it is in run {RUN}" in answers[0].reason


async def test_a_stop_on_any_topic_takes_the_robot_out_and_the_run_has_failed(cloud, requests):
    await flies(cloud, requests)
    stop = cloud.robot.read("command", b'{"command": "stop"}', transport=Transport.CLOUD)
    stop(lambda _: None)
    await requests.until(lambda: cloud.terminal)
    assert cloud.terminal == ["failed"]
    assert "stopped" in cloud.reported()[-1][1]


async def test_the_history_says_who_was_refused(cloud, requests):
    events = []
    cloud.edge.process.history.on_event = lambda robot, event: events.append((robot, event))
    cloud.say(START, source_type="edit")
    await requests.until(lambda: events)
    ((robot, event),) = events
    assert (robot, event.asker.name, event.request) == ("rex", "anna", RUN)
    assert event.text == "mission refused: source_type 'edit'; this robot accepts edge, tele"


def test_every_end_of_a_run_is_a_state_of_the_contract():
    assert set(STATES) == set(RunOutcome)
    assert all(state.terminal for state in STATES.values())
    ended = RunState("r", "yard", "patrol", "ended", "end", 0.0, outcome="undo_failed", reason="rex fell")
    assert status_of(ended) == (ActionState.FAILED, "undo_failed: rex fell")


def test_a_run_that_asks_is_running_and_tells_its_question():
    requesting = RunState(
        "r", "yard", "plan", "asking", "fly.1", 0.0, question=PendingQuestion(1, "Go on?", 9.0, "abort")
    )
    assert status_of(requesting) == (ActionState.RUNNING, "asks: Go on?")


def test_a_plan_that_is_part_of_a_run_is_reported_as_that_run_and_never_ends_it():
    part = NavigationReport(1.0, f"{RUN}/fly.1/rex/1", ActionState.COMPLETED, 100.0, "", 3)
    ((suffix, payload),) = to_mqtt(part, sender(source_type="edge", session="s"))
    message = json.loads(payload)
    assert (suffix, message["mission_execution_uuid"]) == ("mission/status", RUN)
    assert (message["status"], message["current_step"]) == ("running", 3)


async def test_the_item_that_a_robot_is_at_is_reported_with_the_end(cloud, requests):
    run = await flies(cloud, requests)
    (part,) = run.engine.robots.active()
    await requests.until(lambda: [each["status"] for each in cloud.statuses].count("running") >= 3)  # its own
    report = NavigationReport(1.0, part.identity, ActionState.RUNNING, 50.0, "", 4)
    cloud.edge.missions.plans.record_item(encode_report(report, 1))
    cloud.edge.missions.plans.record_item(b"no report")
    run.handle(Replied(part.identity, PartOutcome.DONE, ""))
    await requests.until(lambda: cloud.terminal)
    assert (cloud.statuses[-1]["status"], cloud.statuses[-1]["current_step"]) == ("completed", 4)
