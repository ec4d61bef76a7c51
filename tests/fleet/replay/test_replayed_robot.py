"""A robot in a replay: its calls are made when the recording has their reports, and its reports are kept."""

import asyncio
import contextlib

import pytest

from fleet.errors import Unsupported
from fleet.link.tap import LinkFrame
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import BatteryReport, PoseReport, TelemetryReport
from fleet.replay.recorded_robot import RecordedRobot
from fleet.replay.replayed_robot import RecordedTime, ReplayedRobot
from fleet.robot_config import Limits
from fleet.testing.clock import JumpingLoop

BEGINS = 1_700_000_000.0  # Unix s


class Bench:
    """A replayed robot, and the times (s after the start) at which its calls were made."""

    def __init__(self, known=None):
        self.loop = asyncio.get_running_loop()
        self.began = self.loop.time()
        recorded = RecordedRobot("yard", "rex", (("main", LinkFrame(BEGINS, "open")),), {})
        self.state = {}
        self.robot = ReplayedRobot(recorded, Limits(speed=1.0), RecordedTime(BEGINS), self.state, known)
        self.calls = []

    def now(self):
        return round(self.loop.time() - self.began, 6)

    def every(self, seconds, name, *reports):
        def call():
            self.calls.append((name, self.now()))
            for report in reports:
                self.robot.report(report)

        self.robot.every(seconds, call)


def replayed(work, known=None):
    """Return what ``work(bench)`` returns, in time that jumps."""

    async def whole():
        bench = Bench(known)
        try:
            return await work(bench)
        finally:
            await bench.robot.close()

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


def battery(stamp=BEGINS, percent=50.0):
    return BatteryReport(stamp, percent)


def test_time_begins_with_the_recording_and_goes_on_with_the_loop():
    async def work(bench):
        first = bench.robot.clock.time(), bench.robot.clock.monotonic()
        await asyncio.sleep(2.5)
        return first, bench.robot.clock.time(), bench.robot.clock.monotonic() - first[1]

    (first, _), later, passed = replayed(work)
    assert (first, later, passed) == (BEGINS, BEGINS + 2.5, 2.5)


def test_reports_are_kept_by_channel_with_their_stamp_and_content():
    async def work(bench):
        bench.robot.report(battery(BEGINS + 1.0))
        bench.robot.report(battery(BEGINS + 2.0, 49.0))
        bench.robot.report(PoseReport(BEGINS, Vector3(1.0), Quaternion()))
        bench.robot.report(TelemetryReport(BEGINS, "connected"))
        return bench.robot.said

    said = replayed(work)
    assert {"battery", "position"} < set(said)
    assert [one.stamp for one in said["battery"]] == [BEGINS + 1.0, BEGINS + 2.0]
    assert said["battery"][0].content != said["battery"][1].content
    assert any(channel.startswith("telemetry:") for channel in said)


def test_a_report_that_may_not_go_out_is_left_out():
    async def work(bench):
        bench.robot.report(battery(percent=float("nan")))
        bench.robot.report(battery())
        return bench.robot.said

    assert [len(each) for each in replayed(work).values()] == [1]


def test_at_first_each_call_is_made_at_every_recorded_time_to_learn_its_channels():
    async def work(bench):
        bench.every(10.0, "power", battery())
        bench.every(10.0, "nothing")
        bench.robot.at("position")
        bench.robot.at("battery")
        return bench.calls, bench.robot.channels

    calls, channels = replayed(work)
    assert [name for name, _ in calls] == ["power", "nothing"] * 2
    assert channels == {0: frozenset({"battery"})}


def test_then_a_call_that_reports_is_made_at_the_times_of_its_channels_alone():
    async def work(bench):
        bench.every(0.1, "power", battery())
        bench.every(1.0, "keepalive")
        await asyncio.sleep(1.5)
        bench.robot.at("battery")
        bench.robot.at("position")
        await asyncio.sleep(1.0)
        return bench.calls

    calls = replayed(work, {0: frozenset({"battery"})})
    assert calls == [("keepalive", 1.0), ("power", 1.5), ("keepalive", 2.0)]


def test_what_is_reported_outside_of_a_call_is_of_no_call():
    async def work(bench):
        bench.every(0.1, "nothing")
        bench.robot.at("battery")
        bench.robot.report(battery())
        return bench.calls, bench.robot.channels

    assert replayed(work) == ([("nothing", 0.0)], {})


@pytest.mark.parametrize("known", [None, {}])
def test_a_call_goes_by_its_period_while_nothing_is_known_of_its_reports(known):
    async def work(bench):
        bench.every(0.5, "tick")
        await asyncio.sleep(1.7)
        return bench.calls

    assert replayed(work, known) == [("tick", 0.5), ("tick", 1.0), ("tick", 1.5)]


def test_a_call_may_add_another_one_at_a_recorded_time():
    async def work(bench):
        bench.robot.every(10.0, lambda: bench.every(10.0, "second"))
        bench.robot.at("battery")
        first = list(bench.calls)
        bench.robot.at("battery")
        return first, bench.calls

    assert replayed(work) == ([], [("second", 0.0)])


@pytest.mark.parametrize("how", ["by its period", "at a recorded time"])
def test_a_call_that_fails_ends_the_attempt_with_its_first_error(how):
    async def work(bench):
        errors = iter([KeyError("charge"), ValueError("later")])

        def fail():
            raise next(errors)

        bench.robot.every(0.5, fail)
        if how == "by its period":
            await asyncio.sleep(1.2)
        else:
            bench.robot.at("battery")
            bench.robot.at("battery")
        assert bench.robot.failed.done()
        return bench.robot.failed.exception()

    assert isinstance(replayed(work), KeyError)


def test_the_end_of_an_attempt_ends_its_calls_and_leaves_what_it_entered():
    async def work(bench):
        left = []
        context = contextlib.AsyncExitStack()
        context.callback(left.append, "left")
        assert await bench.robot.enter(context) is context
        bench.every(0.5, "tick")
        await bench.robot.close()
        await asyncio.sleep(2.0)
        bench.robot.at("battery")
        return left, bench.calls, bench.robot.failed.cancelled()

    assert replayed(work) == (["left"], [], True)


def test_what_reaches_out_of_the_recording_is_refused_or_nobodys():
    async def work(bench):
        with pytest.raises(Unsupported, match="a replay makes no blocking calls"):
            await bench.robot.blocking(print)
        made = contextlib.AsyncExitStack()
        return bench.robot.share("key", lambda: made) is made, bench.robot.state is bench.state

    assert replayed(work) == (True, True)
