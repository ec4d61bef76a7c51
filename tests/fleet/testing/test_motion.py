"""Motion trials: a robot that does what it is told passes, and each way to fail is found."""

import asyncio

import pytest

from fleet.errors import LinkLost, NotReady
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.robot_config import Limits
from fleet.testing import motion
from fleet.testing.motion import MotionTrial, trial_velocities

AHEAD = Velocity(Vector3(0.5))


class Bench:
    """A bench with a robot that turns what it is told into what it does; time passes at once."""

    def __init__(self, does=lambda velocity, _now: velocity):
        self.adapter = self
        self.does = does
        self.told = ZERO_VELOCITY
        self.stopped = []
        self.since = 0.0
        self.trial = MotionTrial(self, self.velocity, 3.0)

    def velocity(self):
        return self.does(self.told, self.since)

    def drive(self, velocity):
        if velocity != self.told:
            self.told, self.since = velocity, 0.0

    async def stop(self, reason):
        self.stopped.append(reason)
        await self.ends()
        self.drive(ZERO_VELOCITY)

    async def ends(self):
        pass

    def halt(self):
        self.stopped.append("halt")
        self.drive(ZERO_VELOCITY)

    async def pass_time(self, seconds):
        self.since += seconds


async def fails(work, match):
    with pytest.raises(AssertionError, match=match):
        await work


async def test_a_robot_that_follows_drives_stops_and_stands():
    bench = Bench()
    await bench.trial.drive(AHEAD)
    await bench.trial.stop()
    await bench.trial.expect_still("after a stop")
    assert bench.stopped == ["stop"]
    await bench.trial.halt()
    assert bench.stopped == ["stop", "halt"]


@pytest.mark.parametrize(
    "does",
    [
        lambda velocity, _now: Velocity(velocity.linear.scaled(-1.0)),
        lambda velocity, _now: Velocity(velocity.linear.scaled(1000.0)),
        lambda velocity, _now: Velocity(Vector3(0.0, velocity.linear.x)),
        lambda velocity, now: velocity if now > 3.1 else ZERO_VELOCITY,
        lambda velocity, _now: None,
    ],
    ids=["sign", "unit", "axis", "late", "unknown"],
)
async def test_a_robot_that_does_something_else_is_found(does):
    await fails(Bench(does).trial.drive(AHEAD), "unit, axis, sign")


async def test_a_robot_that_takes_a_while_follows_all_the_same():
    bench = Bench(lambda velocity, now: velocity if now > 2.5 else ZERO_VELOCITY)
    await bench.trial.drive(AHEAD)


async def test_a_robot_may_take_a_last_step_and_report_nothing_while_it_stands():
    bench = Bench(lambda _velocity, now: AHEAD if now < 1.0 else None)
    await bench.trial.expect_still("after a stop")


@pytest.mark.parametrize("begins", [0.0, 0.7])
async def test_a_robot_that_goes_on_after_a_stop_is_found(begins):
    bench = Bench(lambda _velocity, now: AHEAD if now > begins else ZERO_VELOCITY)
    await fails(bench.trial.expect_still("after a stop"), "it moves after a stop")


async def test_a_robot_that_stands_and_then_jolts_is_found():
    bench = Bench(lambda _velocity, now: AHEAD if 0.7 < now < 1.0 else ZERO_VELOCITY)
    await fails(bench.trial.expect_still("after a stop"), "it moves after a stop")


async def test_a_robot_whose_pose_comes_late_and_shows_motion_is_found():
    bench = Bench(lambda _velocity, now: AHEAD if now > 1.2 else None)
    await fails(bench.trial.expect_still("after a stop"), "it moves after a stop")


@pytest.mark.parametrize("error", [NotReady("it slips"), LinkLost("no cable")])
async def test_what_an_adapter_may_raise_in_a_stop_is_no_failure(error):
    bench = Bench()

    async def ends():
        raise error

    bench.ends = ends
    await bench.trial.stop()


async def test_a_stop_that_hangs_or_crashes_is_found(monkeypatch):
    monkeypatch.setattr(motion, "STOP_WITHIN", 0.01)
    bench = Bench()
    bench.ends = asyncio.Event().wait
    await fails(bench.trial.stop(), r"stop does not return within 0\.01 s")
    bench.ends = None
    with pytest.raises(TypeError):
        await bench.trial.stop()


class Config:
    """A config with limits of its own."""

    def __init__(self, **limits):
        self.limits = Limits(**limits)


class Adapter:
    """An adapter class with the limits of its kind."""

    limits = Limits(speed=3.0, yaw_rate=1.5)


@pytest.mark.parametrize(
    ("config", "adapter", "velocities"),
    [
        (Config(), Adapter, [(1.0, 0.0), (0.0, 0.5)]),
        (Config(speed=1.5), Adapter, [(0.5, 0.0), (0.0, 0.5)]),
        (Config(), type("Plain", (), {"limits": Limits()}), [(1.0 / 3, 0.0)]),
    ],
)
def test_a_third_of_the_limits_is_tried_ahead_and_turning(config, adapter, velocities):
    found = [(each.linear.x, each.yaw_rate) for each in trial_velocities(config, adapter)]
    assert found == velocities
