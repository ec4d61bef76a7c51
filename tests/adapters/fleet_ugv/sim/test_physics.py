"""The motion of a simulated base: sides that follow with a lag, stick, slip and are pushed."""

import math

import pytest

from fleet_ugv.sim.physics import STEP, BaseBody, Physics

BODY = BaseBody(track=0.2, lag=0.1, sticks=0.05, fastest=0.6)


def driven(left, right, seconds, physics=None, body=BODY):
    physics = physics or Physics(body)
    physics.wanted = [left, right]
    for _ in range(round(seconds / STEP)):
        physics.step()
    return physics


def test_a_base_goes_straight_and_both_sides_count_it():
    physics = driven(0.4, 0.4, 5.0)
    assert (physics.y, physics.yaw) == (0.0, 0.0)
    assert physics.x == pytest.approx(0.4 * (5.0 - BODY.lag), abs=0.01)
    assert physics.distances == pytest.approx([physics.x, physics.x])
    assert physics.speed == pytest.approx(0.4)


def test_a_side_follows_with_its_lag():
    assert driven(0.4, 0.4, BODY.lag).speed == pytest.approx(0.4 * (1 - 1 / math.e), abs=0.02)
    assert Physics(BODY).acceleration == 0.0
    assert driven(0.4, 0.4, STEP).acceleration > 0.0


def test_the_right_side_ahead_turns_it_to_the_left():
    physics = driven(-0.1, 0.1, 10.0)
    assert physics.yaw_rate == pytest.approx(0.2 / 0.2)
    assert (physics.x, physics.y) == (0.0, 0.0)
    assert driven(0.1, -0.1, 1.0).yaw < 0.0


def test_a_wider_effective_track_turns_it_less():
    body = BaseBody(track=0.2, lag=0.1, widening=1.25)
    assert driven(-0.1, 0.1, 5.0, body=body).yaw_rate == pytest.approx(0.8)


def test_a_turn_while_it_drives_is_an_arc():
    """With 0.3 and 0.5 m/s at a track of 0.2 m it turns by 1 rad/s on a radius of 0.4 m, after its lag."""
    body = BaseBody(track=0.2, lag=0.0)
    physics = driven(0.3, 0.5, math.pi / 2, body=body)
    assert (physics.x, physics.y) == pytest.approx((0.4, 0.4), abs=0.005)
    assert physics.yaw == pytest.approx(math.pi / 2, abs=0.01)
    driven(0.3, 0.5, 1.5 * math.pi, physics)
    assert (physics.x, physics.y, physics.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)


def test_its_acceleration_is_the_change_of_its_speed_over_time():
    physics = driven(0.4, 0.4, STEP, body=BaseBody(track=0.2, lag=0.0))
    assert (physics.speed, physics.acceleration) == (pytest.approx(0.4), pytest.approx(0.4 / STEP))
    driven(0.4, 0.4, STEP, physics)
    assert physics.acceleration == pytest.approx(0.0)


def test_a_gyro_measures_the_rate_beside_its_bias_and_its_noise():
    quiet = Physics(BaseBody(track=0.2, bias=0.03, noise=0.0))
    assert quiet.gyro() == pytest.approx(0.03)
    driven(-0.1, 0.1, 5.0, quiet)
    assert quiet.gyro() == pytest.approx(1.03)


def test_noise_has_its_size_and_is_the_same_in_every_run():
    one, same, other = Physics(BODY), Physics(BODY), Physics(BODY, seed=2)
    noise = [one.shake(0.5) for _ in range(500)]
    assert noise == [same.shake(0.5) for _ in range(500)]
    assert noise != [other.shake(0.5) for _ in range(500)]
    assert sum(noise) / 500 == pytest.approx(0.0, abs=0.1)
    assert math.sqrt(sum(each * each for each in noise) / 500) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("wanted", "reached"), [(2.0, 0.6), (-2.0, -0.6), (0.05, 0.05), (0.049, 0.0), (-0.049, 0.0)]
)
def test_a_side_is_no_faster_than_it_can_and_sticks_when_it_is_slow(wanted, reached):
    assert driven(wanted, wanted, 3.0).speeds == pytest.approx([reached, reached], abs=1e-6)


def test_a_side_that_stops_comes_to_rest():
    physics = driven(0.4, 0.4, 2.0)
    assert driven(0.0, 0.0, 2.0, physics).speeds == [0.0, 0.0]
    before = physics.x
    assert driven(0.0, 0.0, 1.0, physics).x == before


def test_a_base_that_is_stalled_stands_at_once():
    physics = driven(0.4, 0.4, 2.0)
    physics.stalled = True
    before = list(physics.distances)
    driven(0.4, 0.4, 1.0, physics)
    assert (physics.speed, physics.distances) == (0.0, before)


def test_slip_is_counted_by_the_wheels_and_not_driven():
    physics = Physics(BODY)
    physics.slip = 0.5
    driven(0.4, 0.4, 5.0, physics)
    assert physics.x == pytest.approx(physics.distances[0] / 2)


def test_a_bump_turns_the_base_and_no_wheel():
    physics = Physics(BODY)
    physics.bump(0.5)
    driven(0.0, 0.0, 1.0, physics)
    assert physics.yaw == pytest.approx(0.5)
    assert physics.distances == [0.0, 0.0]
    assert physics.yaw_rate == 0.0
