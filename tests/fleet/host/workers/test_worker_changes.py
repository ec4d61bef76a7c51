"""A worker is restarted with a changed configuration, and gets the one of before where that fails."""

import asyncio
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.process.rebuild import BACK_WITHIN
from fleet.host.robot.rest_check import STILL
from fleet.host.workers import worker_changes
from fleet.host.workers.worker_changes import ENDS_WITHIN, REQUEST_WITHIN, TRY_WITHIN, WorkerChanges
from fleet.model.change import HeldRobot, HoldRequest, HoldRobot, Outcome
from fleet.model.command import Reply, ReplyStatus
from fleet.model.state import RobotState
from fleet.testing.clock import JumpingLoop

SILENT = "worker limbs does not answer"
BY_HAND = "worker limbs was started by hand: end it, and start it with the new file"


class Worker:
    """A worker process with one robot; it is started again when it ends, and is its own bus.

    ``answers``: of each request in order: "": it restarts, "dies": it ends without an answer, "hangs":
    there is no answer, bytes: the answer, else it refuses in these words. The robots are back with the
    tasks ``back`` alone; with the tasks ``broken`` it does not even come up.
    """

    name = "limbs"

    def __init__(self, *answers, back=(b"old",), broken=()):
        self.task, self.given, self.started = b"old", b"old", 1
        self.answers, self.back, self.broken, self.reachable = list(answers), back, broken, True
        self.requests = []

    def replace(self, task):
        before, self.task = self.task, task
        return before

    def start(self):
        self.given, self.reachable = self.task, self.task in self.back
        self.started += self.task not in self.broken

    def request_later(self, key, payload, *, timeout, parameters=None, on_answer, on_end):
        self.requests.append((key, payload, timeout, parameters))
        answer = self.answers.pop(0)
        if answer in {"", "dies"}:
            self.start()
        if isinstance(answer, bytes):
            on_answer(answer)
        elif answer not in {"dies", "hangs"}:
            status = ReplyStatus.REJECTED if answer else ReplyStatus.ACCEPTED
            on_answer(msgspec.json.encode(Reply("reload", status, "" if answer == "?" else answer)))
        on_end()

    @property
    def forced(self):
        return [bool(parameters) for _, _, _, parameters in self.requests]


def robot_of(worker, name="arm", *, of="limbs", silent=False, **fields):
    """Return a robot of a worker, with its state."""

    def state():
        cause = "" if worker.reachable else "unplugged"
        known = {"reachable": worker.reachable, "cause": cause} | fields
        return RobotState(name=name, twin="", adapter="", edge="", stamp=0.0, **known)

    return SimpleNamespace(name=name, worker=of, state=state, silent=silent)


def changes_of(worker, *robots, managed=True):
    return WorkerChanges(
        "yard", worker, {"limbs": worker} if managed else {}, {robot.name: robot for robot in robots}
    )


@pytest.fixture(autouse=True)
def _tasks(monkeypatch):
    """Use configurations that are tasks."""
    monkeypatch.setattr(worker_changes, "task_of", lambda after, _worker: msgspec.Raw(after))


def timed(work):
    """Return the result of a coroutine, and the seconds that it took, in time that jumps."""

    async def whole():
        began = asyncio.get_running_loop().time()
        return await work, asyncio.get_running_loop().time() - began

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


def changed(worker, *others, force=False, gone=""):
    changes = changes_of(worker, robot_of(worker), *others)
    return timed(changes.change("limbs", b"new", force=force, gone=gone))


@pytest.mark.parametrize("force", [False, True])
def test_a_worker_runs_with_the_new_configuration_as_soon_as_its_robots_are_back(force):
    worker = Worker("", back=(b"old", b"new"))
    (outcome, why), took = changed(worker, force=force)
    assert (outcome, why, worker.given, took < 1.0) == (Outcome.DONE, "", b"new", True)
    assert worker.requests == [
        (keys.reload("yard", "limbs"), b"", REQUEST_WITHIN, {"force": "1"} if force else None)
    ]


def test_a_worker_that_refuses_keeps_its_task_also_for_its_next_process():
    worker = Worker("arm is armed; disarm it first")
    assert changed(worker)[0] == (Outcome.REFUSED, "arm is armed; disarm it first")
    assert worker.task == worker.given == b"old"


@pytest.mark.parametrize(("answer", "why"), [("hangs", SILENT), ("?", "it refuses")])
def test_a_worker_without_words_keeps_its_task(answer, why):
    worker = Worker(answer)
    assert changed(worker)[0] == (Outcome.REFUSED, why)
    assert worker.task == b"old"


def test_a_worker_is_not_ended_once_more_while_another_of_its_robots_moves():
    worker = Worker("", "leg is armed; disarm it first")
    (outcome, why), _ = changed(worker)
    assert (outcome, worker.forced) == (Outcome.PARTLY, [False, False])
    assert why == (
        f"arm did not answer within {BACK_WITHIN:g} s: unplugged; "
        "worker limbs goes on with the new configuration: leg is armed; disarm it first"
    )
    assert worker.task == worker.given == b"new"


def test_a_worker_whose_robots_do_not_come_back_runs_with_the_task_of_before():
    worker = Worker("", "")
    (outcome, why), took = changed(worker)
    assert (outcome, round(took)) == (Outcome.FAILED, BACK_WITHIN)
    assert why.endswith("s: unplugged; its previous configuration was restored")
    assert worker.task == worker.given == b"old"


def test_a_worker_that_does_not_come_up_gets_the_task_of_before_though_it_is_silent():
    worker = Worker("", "dies", broken=(b"new",))
    (outcome, why), took = changed(worker)
    assert (outcome, round(took)) == (Outcome.FAILED, ENDS_WITHIN)
    assert why == "worker limbs did not come up within 15 s; its previous configuration was restored"
    assert worker.given == b"old"


def test_a_worker_that_does_not_come_back_with_either_task_is_reported_with_both():
    worker = Worker("", "", back=())
    (outcome, why), took = changed(worker)
    absent = f"arm did not answer within {BACK_WITHIN:g} s: unplugged"
    assert (outcome, why, round(took)) == (Outcome.FAILED, f"{absent}; {absent}", 2 * BACK_WITHIN)


def test_a_worker_that_died_and_came_up_with_the_change_is_not_reported_as_unchanged():
    worker = Worker("dies", "")
    (outcome, _why), _ = changed(worker)
    assert (outcome, worker.task, worker.given) == (Outcome.FAILED, b"old", b"old")


def test_a_robot_that_was_away_before_or_is_gone_afterwards_is_not_waited_for():
    worker = Worker("", back=(b"old", b"new"))
    away = robot_of(worker, "leg", reachable=False, cause="unplugged")
    assert changed(worker, away)[0] == (Outcome.DONE, "")
    assert changed(Worker(""), gone="arm")[0] == (Outcome.DONE, "")


def test_a_worker_that_says_nothing_is_not_asked_and_not_waited_for():
    worker = Worker()
    changes = changes_of(worker, robot_of(worker, silent=True))
    assert timed(changes.hold("limbs", {})) == ({}, 0.0)
    assert timed(changes.regroup({"all": ["arm"]})) == (SILENT, 0.0)
    assert timed(changes.change("limbs", b"new", force=True)) == ((Outcome.REFUSED, SILENT), 0.0)
    assert (worker.requests, worker.task) == ([], b"old")


def test_a_worker_with_one_robot_that_speaks_is_not_silent():
    worker = Worker("", back=(b"old", b"new"))
    assert changed(worker, robot_of(worker, "leg", silent=True))[0] == (Outcome.DONE, "")


def test_a_worker_that_was_started_by_hand_is_for_a_person():
    worker = Worker()
    changes = changes_of(worker, robot_of(worker), managed=False)
    assert timed(changes.change("limbs", b"new", force=True))[0] == (Outcome.REFUSED, BY_HAND)
    assert changes.blocker("limbs") == BY_HAND
    changes.runs_with("limbs", b"new")
    assert worker.task == b"old"


BUSY = [
    ({}, False),
    ({"activity": "emergency stop"}, False),
    ({"speed": STILL}, False),
    ({"speed": STILL + 0.01}, True),
    ({"activity": "commanded"}, True),
    ({"armed": True}, True),
    ({"run": "r1"}, True),
    ({"activity": "emergency stop", "armed": True}, True),
]


@pytest.mark.parametrize(("state", "blocks"), BUSY)
def test_a_worker_restarts_only_while_all_its_robots_rest(state, blocks):
    worker = Worker()
    other = robot_of(worker, "rex", of="cell", activity="commanded")
    changes = changes_of(worker, robot_of(worker), robot_of(worker, "leg", **state), other)
    assert changes.blocker("limbs") == ("leg, of the same worker, does not rest" if blocks else "")


def test_the_settings_that_a_worker_holds_its_robots_to_come_back_by_name():
    held = {"arm": HeldRobot(changed=True, settings="{}")}
    worker = Worker(msgspec.json.encode(held))
    wanted = {"arm": HoldRobot("{}", whole=True)}
    assert timed(changes_of(worker, robot_of(worker)).hold("limbs", wanted))[0] == held
    ((key, payload, timeout, _),) = worker.requests
    assert (key, timeout) == (keys.hold("yard", "limbs"), REQUEST_WITHIN)
    assert msgspec.json.decode(payload, type=HoldRequest) == HoldRequest(wanted, groups=None)


def test_new_groups_go_to_each_worker_and_the_one_that_hangs_is_named():
    worker = Worker("hangs")
    assert timed(changes_of(worker, robot_of(worker)).regroup({"crew": ("arm",)}))[0] == SILENT
    assert msgspec.json.decode(worker.requests[0][1], type=HoldRequest).groups == {"crew": ["arm"]}


def test_a_changed_file_is_named_to_the_worker_which_has_time_to_check_it():
    worker = Worker("")
    assert timed(changes_of(worker).start_again("limbs", "toy", force=False))[0] == ""
    assert worker.requests == [(keys.reload("yard", "limbs"), b"toy", TRY_WITHIN, None)]


def test_what_all_run_with_is_the_task_of_each_next_process():
    worker = Worker()
    changes_of(worker).all_run_with(b"new")
    assert (worker.task, worker.given) == (b"new", b"old")
