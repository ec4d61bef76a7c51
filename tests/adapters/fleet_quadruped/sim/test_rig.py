"""A dog and its controller in one time: what a test may ask of them, and what it is told."""

import msgspec
import pytest

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import copied, stood_up, stood_up_in_physics


@pytest.fixture
def quick(mit_dog):
    """Return a dog that stands up quickly."""
    quickly = mit_dog.poses.model_copy(update={"rise_time": 0.3})
    soon = mit_dog.safety.model_copy(update={"damp_time": 0.5})
    return mit_dog.model_copy(update={"poses": quickly, "safety": soon})


@pytest.fixture
def rig(quick):
    return Rig(quick)


def test_time_passes_in_whole_cycles_alone(rig):
    assert rig.sim.time == 0.0
    rig.go(0.05)
    assert rig.sim.time == pytest.approx(0.05)
    rig.request(BodyRequest.HEIGHT, 0.01)
    assert rig.sim.time == pytest.approx(0.06)


def test_it_goes_on_until_a_mode_or_until_the_time_is_over(rig):
    rig.settle()
    rig.request(BodyRequest.STAND)
    rig.go(3.0, until=BodyMode.RISING)
    begun = rig.sim.time
    assert (rig.mode, begun < 1.0) == (BodyMode.RISING, True)
    rig.go(0.05, until=BodyMode.STANDING)
    assert (rig.mode, rig.sim.time) == (BodyMode.RISING, pytest.approx(begun + 0.05))


def test_the_order_of_a_host_that_lives_is_fresh_and_of_another_one_stays_as_it_is(rig):
    rig.go(0.03)
    assert (rig.order.alive, rig.order.until) == pytest.approx((0.02, 1.02))
    rig.alive = False
    rig.go(0.03, Twist(0.3, 0.1, 0.2))
    assert (rig.order.alive, rig.order.x, rig.order.y, rig.order.turn) == pytest.approx((0.02, 0.3, 0.1, 0.2))


def test_a_request_is_answered_with_its_refusal(rig):
    rig.go(0.05)
    assert rig.request(BodyRequest.HEIGHT, 0.01) == "it is off; stand up first"
    assert rig.request(BodyRequest.STAND) == ""
    assert rig.order.activity.number == 2


def test_it_stands_and_says_why_it_does_not(rig):
    rig.stand()
    assert (rig.mode, rig.fault) == (BodyMode.STANDING, "")
    rig.sim.fault("hot", 8)
    rig.go(0.05)
    assert "RL_hip" in rig.fault
    with pytest.raises(AssertionError, match="RL_hip"):
        rig.stand()


def test_an_emergency_stop_takes_effect_in_the_next_cycle_and_damps_all_joints(rig):
    rig.stand()
    for motor in rig.sim.world.motors:
        motor.kp, motor.kd = 0.0, 3.0
    assert not rig.is_compliant(), "it was not told to be"
    rig.emergency()
    assert rig.mode is BodyMode.STANDING
    rig.go(0.03)
    assert rig.mode is BodyMode.DAMPED
    assert rig.is_compliant()
    rig.sim.world.motors[7].kd = 0.0
    assert not rig.is_compliant()
    assert rig.is_compliant([0, 1])


def test_it_is_watched_after_each_cycle(rig):
    seen = []
    rig.watch = lambda: seen.append(rig.sim.time)
    rig.go(0.03)
    assert seen == pytest.approx([0.01, 0.02, 0.03])


def test_the_largest_tilt_is_that_of_the_last_time(rig, monkeypatch):
    rig.sim.fault("imu")  # else it is measured, too
    tilts, level = iter([0.5, 0.3, 0.1]), rig.sim.world.imu()
    monkeypatch.setattr(rig.sim.world, "imu", lambda: Tilted(level, next(tilts)))
    rig.go(0.01)
    assert rig.tilt == 0.5
    rig.go(0.02)
    assert rig.tilt == 0.3


class Tilted:
    """A measurement of an IMU with another tilt."""

    def __init__(self, imu, tilt):
        self.rotation, self.gyro, self.accel, self.tilt = imu.rotation, imu.gyro, imu.accel, tilt


def test_a_controller_that_is_new_finds_the_dog_as_it_is(rig):
    rig.stand()
    before = rig.controller
    rig.order = msgspec.structs.replace(rig.order, x=0.5)
    rig.reconnect()
    assert (rig.controller is before, rig.order.x, rig.mode) == (False, 0.0, BodyMode.OFF)
    rig.settle()
    assert rig.mode is BodyMode.OFF
    assert all(motor.kp == 0 for motor in rig.sim.world.motors)


def test_the_clock_of_the_controller_may_be_another_one(rig):
    rig.skew = 100.0
    rig.go(0.03)
    assert (rig.state().stamp, rig.order.alive) == pytest.approx((100.03, 100.02))


def test_a_dog_may_be_built_otherwise_than_its_controller_believes(mit_dog):
    tree = mit_dog.model_dump(by_alias=True)
    tree["joints"]["RL_hip"]["offset"] = 0.2
    rig = Rig(mit_dog, real=type(mit_dog).model_validate(tree))
    rig.go(0.05)
    measured = rig.state().angles[7]
    assert measured - rig.sim.world.motors[7].angle == pytest.approx(0.2, abs=0.01)


@pytest.mark.combinations
@pytest.mark.parametrize("make", [stood_up, stood_up_in_physics])
def test_a_copy_does_what_the_rig_would_have_done_and_leaves_it_as_it_is(any_dog, make):
    original = make(any_dog)
    before = original.state()
    copies = [walked(copied(original)) for _ in range(2)]
    assert original.state() == before
    assert copies[0] == copies[1] == walked(original)


def walked(rig):
    """Return what becomes of a standing dog on bad wires: its states, its motors and what it was sent."""
    seen = []
    rig.sim.fault("loss", 0.05)
    rig.watch = lambda: seen.append((rig.state(), str(rig.sim.world.motors), list(rig.buses["a"].sent)))
    rig.go(0.5, Twist(0.4, 0.1, 0.3))
    rig.emergency()
    rig.go(0.2)
    assert len(seen) == 70
    return seen
