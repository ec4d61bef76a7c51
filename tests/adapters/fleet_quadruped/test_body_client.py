"""Orders to a body controller, and waiting for what its states say, in a time of their own."""

import asyncio
import threading

import pytest

from fleet import Fault, Level, LinkLost, Refused, TimedOut
from fleet.testing.robot import RecordingRobot
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.body_client import BodyClient
from fleet_quadruped.control.orders import DogState, LoopTiming, Order

DT = 0.01
HEALTHY = LoopTiming(realtime=True, rate=100.0)


class Shared:
    """One value in shared memory, as a process of its own writes or reads it."""

    def __init__(self, value):
        self.value = value

    def put(self, value):
        self.value = value

    def get(self):
        return self.value


class Body:
    """A body controller of which nothing but its memory is there."""

    def __init__(self):
        self.orders, self.states = Shared(Order()), Shared(DogState())


class Bench:
    def __init__(self, *, lamp=None, recorded=lambda: False):
        self.robot, self.body = RecordingRobot("rex"), Body()
        self.client = BodyClient(self.robot, lamp=lamp)
        self.client.begin(self.body, DT, recorded=recorded)

    @property
    def order(self):
        return self.body.orders.value

    def say(self, **state):
        """Have the body controller say a state now, and the client read it."""
        self.body.states.value = DogState(**{"stamp": self.client.now(), "timing": HEALTHY} | state)
        self.client.poll()


@pytest.fixture
def bench():
    return Bench()


async def begun(awaitable):
    """Start a wait; return its task once it waits."""
    task = asyncio.create_task(awaitable)
    for _ in range(3):
        await asyncio.sleep(0)
    return task


def test_it_begins_with_an_order_that_asks_for_nothing_and_lives_from_now(bench):
    assert bench.order == Order(alive=bench.client.now())


@pytest.mark.parametrize("lamp", [True, False])
def test_the_lamp_is_in_its_first_order(lamp):
    assert Bench(lamp=lamp).order.lamp is lamp


def test_an_order_is_kept_and_sent_again_with_a_new_time(bench):
    bench.client.change({"x": 0.4, "until": 99.0})
    bench.robot.clock.advance(0.2)
    bench.client.send()
    assert (bench.order.x, bench.order.until) == (0.4, 99.0)
    assert bench.order.alive == bench.client.now()


def test_each_stop_is_a_higher_number_and_the_rest_of_the_order_stays(bench):
    bench.client.change({"x": 0.4}, stops=1, halts=1)
    bench.client.change({}, halts=1)
    assert (bench.order.x, bench.order.stop, bench.order.halts) == (0.4, 1, 2)


def test_no_stop_from_another_thread_is_lost():
    others = []

    def meanwhile():
        """Have another thread stop the dog while an order is being changed."""
        if others and not others[0].ident:
            others[0].start()
            others[0].join(0.02)
        return False

    bench = Bench(recorded=meanwhile)
    others.append(threading.Thread(target=lambda: bench.client.change({}, stops=1, halts=1)))
    bench.client.change({"x": 0.4}, halts=1)
    others[0].join()
    assert (bench.order.stop, bench.order.halts, bench.order.x) == (1, 2, 0.4)


def test_it_asks_for_frames_while_they_are_recorded():
    recorded = []
    bench = Bench(recorded=lambda: bool(recorded))
    assert not bench.order.frames
    recorded.append("on")
    bench.client.send()
    assert bench.order.frames
    recorded.clear()
    bench.client.change({"lamp": True})
    assert not bench.order.frames


def test_its_health_is_told_with_the_first_state_and_with_each_change_alone(bench):
    bench.client.poll()
    assert bench.robot.healths == []
    bench.say()
    bench.say()
    assert [health.level for health in bench.robot.healths] == [Level.OK]
    bench.say(fault="RL_hip: over-current")
    bench.say(fault="RL_hip: over-current")
    assert len(bench.robot.healths) == 2
    assert "RL_hip: over-current" in bench.robot.healths[-1].cause


def test_a_slow_rate_is_measured_against_its_own_cycle_time(bench):
    bench.say(timing=LoopTiming(realtime=True, rate=60.0))
    assert bench.robot.healths[-1].level is Level.DEGRADED


def test_a_body_that_says_nothing_for_a_second_is_frozen(bench):
    bench.say()
    bench.robot.clock.advance(1.0)
    bench.client.poll()
    bench.robot.clock.advance(0.1)
    with pytest.raises(LinkLost, match=r"the body controller is frozen: no state for 1\.1 s"):
        bench.client.poll()
    assert bench.robot.healths[-1].level is Level.OFFLINE


def test_a_body_that_never_spoke_is_frozen_a_second_after_its_start(bench):
    bench.robot.clock.advance(1.01)
    with pytest.raises(LinkLost, match="frozen"):
        bench.client.poll()


async def test_a_request_is_sent_once_and_done_with_its_answer(bench):
    task = await begun(bench.client.request(BodyRequest.HEIGHT, 0.03))
    activity = bench.order.activity
    assert (activity.number, activity.request, activity.value) == (1, BodyRequest.HEIGHT, 0.03)
    bench.say(answered=0)
    await asyncio.sleep(0)
    assert not task.done()
    bench.say(answered=1)
    assert await task is None


async def test_a_refusal_is_raised_in_the_words_of_the_body(bench):
    task = await begun(bench.client.request(BodyRequest.STAND))
    bench.say(answered=1, refusal="it is on its back; send recovery_stand")
    with pytest.raises(Refused, match="it is on its back; send recovery_stand"):
        await task


async def test_requests_go_one_by_one_each_with_a_number_of_its_own(bench):
    first = await begun(bench.client.request(BodyRequest.STAND))
    second = await begun(bench.client.request(BodyRequest.POSE))
    assert bench.order.activity.request is BodyRequest.STAND
    bench.say(answered=1)
    await first
    for _ in range(3):
        await asyncio.sleep(0)
    assert (bench.order.activity.number, bench.order.activity.request) == (2, BodyRequest.POSE)
    assert not second.done()
    bench.say(answered=2)
    await second


async def test_a_mode_is_waited_for(bench):
    bench.say(mode="enabling")
    task = await begun(bench.client.reach({"standing", "walking"}, "standing up", 5.0))
    bench.say(mode="rising")
    await asyncio.sleep(0)
    assert not task.done()
    bench.say(mode="walking")
    await task


@pytest.mark.parametrize(
    ("mode", "fault", "expected"),
    [("off", "emergency stop", "emergency stop"), ("damped", "", "it is damped"), ("off", "", "it is off")],
)
async def test_drives_that_go_off_instead_of_a_mode_are_a_fault(bench, mode, fault, expected):
    bench.say(mode="rising")
    task = await begun(bench.client.reach({"standing"}, "standing up", 5.0))
    bench.say(mode=mode, fault=fault)
    with pytest.raises(Fault, match=f"^{expected}$"):
        await task


async def test_what_does_not_come_in_time_is_said_with_the_mode_and_the_time(bench):
    bench.say(mode="rising")
    with pytest.raises(TimedOut, match=r"^standing up: the dog is rising after 0\.001 s$"):
        await bench.client.reach({"standing"}, "standing up", 0.001)


async def test_what_is_so_already_is_not_waited_for(bench):
    bench.say(mode="standing")
    await bench.client.reach({"standing"}, "standing up", 0.0)
    bench.say(mode="off")
    with pytest.raises(Fault, match="it is off"):
        await bench.client.reach({"standing"}, "standing up", 0.0)
