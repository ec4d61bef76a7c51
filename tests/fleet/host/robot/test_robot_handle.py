import asyncio

import pytest

from fleet.clock import SystemClock
from fleet.host.robot.robot_handle import KEPT_WITHIN, RobotHandle
from fleet.host.runtime.blocking_calls import BlockingCalls
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.model.health import Health, Level
from fleet.model.report import BatteryReport
from fleet.robot_config import Limits
from fleet.supervisor.client import SupervisorClient
from fleet.testing.clock import ManualClock


class Heard:
    """A handle, and everything it passes on."""

    def __init__(self, supervised=None, *, connected=True):
        self.all = []
        self.latched = False
        self.lacking = {}
        self.scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
        self.handle = RobotHandle(
            "rex",
            limits=Limits(),
            state={},
            calls=BlockingCalls("rex"),
            clock=ManualClock(),
            scheduler=self.scheduler,
            shared=SharedResources(),
            publish=self.all.append,
            healthy=self.all.append,
            lost_authority=self.all.append,
            latched=lambda: self.latched,
            lacking=self.lacking,
            circled=self.all.append,
            failed=self.all.append,
            supervised=supervised or SupervisorClient(),
        )
        if connected:
            self.handle.connected(answers=False)

    def say_everything(self):
        self.handle.report(BatteryReport(1.0))
        self.handle.health(Health(Level.OFFLINE, "gone"))
        self.handle.authority_lost("a pilot")


async def test_an_adapter_sees_whether_an_emergency_stop_is_set():
    heard = Heard()
    assert not heard.handle.emergency_stop
    heard.latched = True
    assert heard.handle.emergency_stop


async def test_what_an_adapter_says_is_passed_on():
    heard = Heard()
    heard.say_everything()
    assert heard.all == [BatteryReport(1.0), Health(), Health(Level.OFFLINE, "gone"), "a pilot"]


async def test_the_first_report_says_that_the_robot_answers():
    heard = Heard()
    heard.handle.report(BatteryReport(1.0))
    heard.handle.report(BatteryReport(2.0))
    assert heard.all == [BatteryReport(1.0), Health(), BatteryReport(2.0)]


async def test_a_report_says_nothing_of_a_robot_whose_adapter_speaks_for_itself():
    heard = Heard()
    heard.handle.health(Health(Level.OFFLINE, "not heard yet"))
    heard.handle.report(BatteryReport(1.0))
    assert heard.all == [Health(Level.OFFLINE, "not heard yet"), BatteryReport(1.0)]


@pytest.mark.parametrize(
    ("said", "answers", "health"),
    [
        ([], False, []),
        ([], True, [Health()]),
        ([Health(Level.OFFLINE, "not yet")], True, [Health(Level.OFFLINE, "not yet")]),
        ([Health()], False, [Health()]),
        ([BatteryReport(1.0)], False, [Health()]),
    ],
)
async def test_health_is_passed_on_once_the_adapter_can_be_asked_to_stop(said, answers, health):
    heard = Heard(connected=False)
    for each in said:
        (heard.handle.health if isinstance(each, Health) else heard.handle.report)(each)
    assert [each for each in heard.all if isinstance(each, Health)] == []
    heard.handle.connected(answers=answers)
    assert [each for each in heard.all if isinstance(each, Health)] == health


async def test_nothing_is_said_through_a_closed_handle():
    heard = Heard()
    heard.handle.close()
    heard.say_everything()
    assert heard.all == []


async def test_the_timers_of_a_run_end_with_it_and_none_begins_after_it(requests):
    heard, calls = Heard(), []
    heard.handle.every(0.02, lambda: calls.append("before"))
    heard.handle.close()
    heard.handle.every(0.02, lambda: calls.append("after"))
    heard.scheduler.every(0.02, lambda: calls.append("the host's own"))
    heard.scheduler.start()
    await requests.until(lambda: len(calls) >= 3)
    heard.scheduler.stop()
    assert set(calls) == {"the host's own"}


class Line:
    """A link that is open."""

    def fileno(self):
        return 1


class Supervisor(SupervisorClient):
    """A supervisor that answers when the test says so."""

    def __init__(self):
        super().__init__()
        self.answers = []
        self.dropped = []
        self.takes = True

    def register(self, robot, descriptor, frames, address=None, *, kept):
        self.answers.append(kept)
        return self.takes

    async def drop(self, robot):
        self.dropped.append(robot)


async def test_a_halt_counts_for_two_seconds_and_then_only_if_it_was_confirmed():
    supervisor = Supervisor()
    heard = Heard(supervisor)
    handle, clock = heard.handle, heard.handle.clock
    assert not handle.has_left_halt
    handle.leave_halt(Line(), [b"halt"])
    handle.health(Health())
    assert handle.has_left_halt, "the answer is on its way"
    clock.advance(KEPT_WITHIN + 0.1)
    assert not handle.has_left_halt
    handle._look_at_halt()
    handle._look_at_halt()
    assert heard.all == [Health()] * 2, "its health is judged once more"
    supervisor.answers[0]()
    assert handle.has_left_halt, "late, but kept"
    handle._look_at_halt()
    assert heard.all == [Health()] * 3
    handle.leave_halt(Line(), [b"other"])
    supervisor.answers[0]()
    clock.advance(KEPT_WITHIN + 0.1)
    assert not handle.has_left_halt, "the answer was of the one before"
    await handle.withdraw_halt()
    assert supervisor.dropped == ["rex"]


async def test_a_halt_that_could_not_be_sent_does_not_count():
    supervisor = Supervisor()
    handle = Heard(supervisor).handle
    supervisor.takes = False
    handle.leave_halt(Line(), [b"halt"])
    assert not handle.has_left_halt


async def test_what_a_robot_lacks_is_what_its_adapter_said_last():
    heard = Heard()
    heard.handle.lacks({"land": "it has wheels", "takeoff": "it has wheels"})
    heard.handle.lacks({"land": "it has a hull"})
    assert heard.lacking == {"land": "it has a hull"}
    heard.handle.close()
    heard.handle.lacks({})
    assert heard.lacking == {"land": "it has a hull"}


async def test_what_a_robot_lacks_without_a_reason_is_refused_with_one():
    heard = Heard()
    heard.handle.lacks({"goto": ""})
    assert heard.lacking == {"goto": "this robot does not have it"}


async def test_the_circle_of_what_cannot_stand_is_passed_on_and_no_other_number():
    heard = Heard()
    heard.handle.circles(95.0)
    assert heard.all[-1] == 95.0
    for radius in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="no radius"):
            heard.handle.circles(radius)
