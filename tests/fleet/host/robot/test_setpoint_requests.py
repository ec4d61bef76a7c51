"""Velocities: the newest counts at once, one that is refused ends motion, as a zero always does."""

import msgspec
import pytest

from fleet.errors import NotReady
from fleet.model.command import ReplyStatus
from fleet.model.geometry import ZERO_VELOCITY

ACCEPTED, REJECTED, DENIED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED, ReplyStatus.DENIED


def statuses(answers):
    return [answer.status for answer in answers]


async def test_a_stale_setpoint_is_refused(bench, requests):
    answers = bench.request(requests.setpoint(stamp=bench.clock.time() - 30))
    assert statuses(answers) == [REJECTED]
    assert bench.adapter.calls == []


@pytest.mark.parametrize("stamp", [-3600.0, -30.0, -0.6, 0.5, 60.0])
async def test_a_zero_ends_motion_however_late_or_early_its_stamp_is(bench, requests, stamp):
    bench.request(requests.setpoint(stamp=bench.clock.time()))
    assert bench.controller.deadman.armed
    zero = requests.setpoint(x=0.0, stamp=bench.clock.time() + stamp)
    assert statuses(bench.request(zero)) == [ACCEPTED]
    assert bench.adapter.calls[-1] == ZERO_VELOCITY
    assert not bench.controller.in_motion
    bench.request(requests.goal())
    await requests.settle()
    assert statuses(bench.request(requests.setpoint(x=0.0, stamp=bench.clock.time() + stamp))) == [ACCEPTED]
    await requests.settle()
    assert not bench.controller.in_motion


@pytest.mark.parametrize("stamp", [None, 0.0, -30.0])
async def test_a_zero_ends_motion_while_nothing_may_move_the_robot(bench, requests, stamp):
    bench.request(requests.setpoint(lease=5.0))
    bench.controller.latch.held = "the edge, which reads its stop input, is silent"
    assert statuses(bench.request(requests.setpoint())) == [REJECTED]
    zero = requests.setpoint(x=0.0, stamp=None if stamp is None else bench.clock.time() + stamp)
    assert statuses(bench.request(zero)) == [ACCEPTED]
    assert bench.adapter.calls[-1] == ZERO_VELOCITY
    assert not bench.controller.in_motion


async def test_a_late_zero_tells_a_robot_that_stands_nothing(bench, requests):
    bench.request(requests.setpoint(x=0.0, stamp=bench.clock.time() - 30))
    assert bench.adapter.calls == []
    assert not bench.controller.motion.in_control


async def test_a_late_zero_ends_no_take_off_and_nothing_that_another_drives(bench, requests):
    bench.request(requests.command("takeoff"))
    await requests.settle()
    (answer,) = bench.request(requests.setpoint(x=0.0, stamp=bench.clock.time() - 30))
    assert answer.reason == "busy with takeoff; send stop first"
    bench.request(requests.command("stop"))
    await requests.settle()
    bench.clock.advance(5.0)
    bench.request(requests.setpoint(session="bert"))
    (answer,) = bench.request(requests.setpoint(x=0.0, session="anna", stamp=bench.clock.time() - 30))
    assert answer.reason == "bert has control for 3.0 s more"
    assert bench.controller.deadman.armed


async def test_a_late_zero_of_one_key_starts_none_that_it_held_back(bench, make_bench, requests, monkeypatch):
    monkeypatch.setattr(type(bench.adapter), "combines_keys", True, raising=False)
    bench = make_bench()
    now = bench.clock.time()
    for verb, x in (("move_forward", 1.0), ("move_backward", -1.0)):
        bench.request(msgspec.structs.replace(requests.setpoint(x=x, stamp=now), name=verb))
    before = len(bench.adapter.calls)
    bench.request(msgspec.structs.replace(requests.setpoint(x=0.0, stamp=now - 3), name="move_backward"))
    assert all(call == ZERO_VELOCITY for call in bench.adapter.calls[before:])
    assert not bench.controller.in_motion


async def test_a_setpoint_is_clamped_and_held_for_its_lease(bench, requests):
    bench.request(requests.setpoint(x=50.0))
    assert bench.adapter.calls[0].linear.x == pytest.approx(2.0)
    bench.clock.advance(0.49)
    assert not bench.controller.deadman.expire(bench.clock.monotonic())
    bench.clock.advance(0.02)
    assert bench.controller.deadman.expire(bench.clock.monotonic())


async def test_a_setpoint_does_not_disturb_a_takeoff(bench, requests):
    bench.request(requests.command("takeoff"))
    await requests.settle()
    (answer,) = bench.request(requests.setpoint())
    assert "takeoff" in answer.reason
    assert bench.adapter.calls == [("takeoff", None)]


async def test_an_adapter_that_refuses_a_velocity_leaves_nothing_armed(bench, requests):
    bench.adapter.raises = NotReady("not in the air")
    (answer,) = bench.request(requests.setpoint())
    assert (answer.status, answer.reason) == (DENIED, "not in the air")
    assert not bench.controller.deadman.armed


async def test_teleoperation_takes_over_from_navigation(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    bench.request(requests.setpoint())
    assert bench.statuses()[-1] == "cancelled"
    assert bench.adapter.calls[-1].linear.x == 1.0


async def test_a_velocity_that_the_robot_refuses_ends_the_one_before_it(bench, requests):
    bench.request(requests.setpoint())
    bench.adapter.raises = NotReady("no sideways")
    bench.request(requests.setpoint(x=0.5))
    assert bench.adapter.calls[-1] == "halt"
    assert not bench.controller.deadman.armed


async def test_a_velocity_that_is_refused_after_taking_over_from_navigation_ends_in_a_halt(bench, requests):
    bench.request(requests.goal())
    await requests.settle()
    bench.adapter.raises = NotReady("not in this mode")
    bench.request(requests.setpoint())
    assert bench.adapter.calls[-1] == "halt"


async def test_a_velocity_that_is_refused_at_rest_touches_nothing(bench, requests):
    bench.adapter.raises = NotReady("not in the air")
    bench.request(requests.setpoint())
    assert bench.adapter.calls == []


async def test_an_adapter_that_crashes_in_a_velocity_is_halted_at_once(bench, requests):
    bench.adapter.raises = ZeroDivisionError("oops")
    bench.request(requests.setpoint())
    assert bench.adapter.calls == ["halt"]


async def test_a_stream_that_is_always_late_moves_nothing_and_its_delay_is_reported(bench, requests):
    answers = []
    for _ in range(50):
        answers += bench.request(requests.setpoint(stamp=bench.clock.time() - 1.9))
        bench.clock.advance(0.1)
    assert {answer.ok for answer in answers} == {False}
    assert "1.90 s behind, or the network delays it as much; clock_skew is 0.3 s" in answers[-1].reason
    assert bench.controller.senders() == {"cloud/anna": 1.9}
