import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fleet import Vector3
from fleet_ugv.model import Feedback
from fleet_ugv.odometry import Scale, WheelOdometry

SCALE = Scale(track=0.2)


def gyro(rate):
    return Vector3(0.0, 0.0, rate)


def run(odometry, feedbacks, every=0.05, start=100.0):
    steps = [odometry.update(feedback, start + number * every) for number, feedback in enumerate(feedbacks)]
    return steps[-1]


def distances_of(left, right, count=21, **more):
    return [
        Feedback(distances=(left * n / (count - 1), right * n / (count - 1)), **more) for n in range(count)
    ]


def test_a_straight_way_is_as_long_as_the_counters_say():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, distances_of(1.0, 1.0, 41))
    assert (odometry.x, odometry.y, odometry.yaw) == pytest.approx((1.0, 0.0, 0.0))
    assert 0 < odometry.position_sigma < 0.2


def test_without_a_gyro_the_heading_comes_from_the_wheels():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, distances_of(-0.1 * math.pi / 2, 0.1 * math.pi / 2))
    assert odometry.yaw == pytest.approx(math.pi / 2)


def test_with_a_gyro_wheels_that_slip_do_not_turn_the_pose():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, distances_of(0.0, 0.4, gyro=gyro(0.1)))
    assert odometry.yaw == pytest.approx(0.1 * 1.0, abs=1e-6)
    assert odometry.heading_sigma < 0.01


def test_a_standing_base_learns_the_gyros_bias_and_does_not_turn():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, [Feedback(distances=(0.0, 0.0), gyro=gyro(0.02))] * 400)
    assert odometry.bias == pytest.approx(0.02, abs=0.001)
    assert abs(odometry.yaw) < 0.015


def test_a_standing_base_that_is_pushed_round_knows_it():
    odometry = WheelOdometry(SCALE, 1.0)
    still = Feedback(distances=(0.0, 0.0), gyro=gyro(0.0))
    run(odometry, [still] * 20 + [Feedback(distances=(0.0, 0.0), gyro=gyro(1.0))] * 10)
    assert odometry.yaw == pytest.approx(0.5)


def test_a_base_that_tells_its_own_heading_is_believed_across_the_half_turn():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, [Feedback(speeds=(0.0, 0.0), yaw=yaw) for yaw in (3.1, -3.1)])
    assert odometry.yaw == pytest.approx(math.tau - 6.2)


def test_speeds_make_the_way_where_there_are_no_counters():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, [Feedback(speeds=(0.5, 0.5))] * 21)
    assert odometry.x == pytest.approx(0.5)


def test_a_counter_reset_is_no_way_back_and_is_reported():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, distances_of(1.0, 1.0, 41))
    step = odometry.update(Feedback(distances=(0.0, 0.0)), 102.05)
    assert step.restarted
    assert odometry.x == pytest.approx(1.0)
    run(odometry, distances_of(0.5, 0.5), start=102.1)
    assert odometry.x == pytest.approx(1.5)


def test_a_spoiled_counter_is_a_jump_that_no_wheel_makes_and_no_reset():
    odometry = WheelOdometry(SCALE, 1.0)
    run(odometry, distances_of(1.0, 1.0, 41))
    assert odometry.update(Feedback(distances=(901.0, 1.0)), 102.05) is None
    odometry.update(Feedback(distances=(1.05, 1.05)), 102.1)
    assert odometry.x == pytest.approx(1.05)


@given(st.floats(0.02, 0.9), st.integers(1, 6))
def test_the_way_of_a_time_when_nobody_listened_is_not_lost(stalled, at_once):
    odometry = WheelOdometry(SCALE, 1.0)
    odometry.update(Feedback(distances=(0.5, 0.5)), 100.0)
    # What was said before the stall is heard after it, and what was said meanwhile with it.
    for number in range(at_once):
        said = 0.5 + 0.8 * stalled * number / at_once
        odometry.update(Feedback(distances=(said, said)), 100.0 + stalled)
    for late in range(1, 41):
        now = 100.0 + stalled + late * 0.05
        said = 0.5 + 0.8 * (now - 100.0)
        odometry.update(Feedback(distances=(said, said)), now)
    assert odometry.x == pytest.approx(said - 0.5, abs=0.05)


def test_counters_that_wrap_go_on():
    wrap = 10.0
    odometry = WheelOdometry(Scale(track=0.2, wrap=wrap), 1.0)
    distances = [4.9 + 0.02 * n for n in range(11)]
    run(odometry, [Feedback(distances=(math.remainder(distance, wrap),) * 2) for distance in distances])
    assert odometry.x == pytest.approx(0.2)


def test_what_happened_in_a_gap_is_unknown_and_time_does_not_run_back():
    odometry = WheelOdometry(SCALE, 1.0)
    odometry.update(Feedback(distances=(0.0, 0.0)), 100.0)
    odometry.update(Feedback(distances=(0.9, 0.9)), 101.5)
    assert odometry.x == 0.0
    assert odometry.update(Feedback(distances=(1.0, 1.0)), 101.4) is None


def test_calibration_scales_each_side_and_can_turn_it_round():
    odometry = WheelOdometry(Scale(track=0.2, left=1.1, right=-0.9), 1.0)
    run(odometry, distances_of(1.0, -1.0, 41))
    assert odometry.travelled == pytest.approx((1.1, 0.9))


@given(st.lists(st.tuples(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(-40, 40)), max_size=30))
@example([(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.265625, 0.0)])  # two are left out
def test_whatever_is_reported_the_pose_stays_finite_and_moves_no_faster_than_wheels_can(samples):
    odometry, taken_at = WheelOdometry(SCALE, 1.0), 100.0
    for number, (left, right, rate) in enumerate(samples):
        now, before = 100.0 + number * 0.05, odometry.pose.position
        step = odometry.update(Feedback(distances=(left, right), gyro=gyro(rate)), now)
        assert (odometry.pose.position - before).norm() <= 1.5 * (now - taken_at) + 0.05 + 1e-9
        taken_at = taken_at if step is None else now


def test_a_gyro_that_is_mounted_upside_down_is_reported_the_right_way_up_and_without_its_bias():
    odometry = WheelOdometry(Scale(track=0.2, gyro=-1.0), 1.0)
    run(odometry, [Feedback(distances=(0.0, 0.0), gyro=gyro(0.02))] * 400)
    assert odometry.level(0.02) == pytest.approx(0.0, abs=0.001)
    assert odometry.level(0.52) == pytest.approx(-0.5, abs=0.001)


def test_a_heading_of_the_bases_own_is_calibrated_like_a_gyro():
    odometry = WheelOdometry(Scale(track=0.2, gyro=-1.0), 1.0)
    run(odometry, [Feedback(speeds=(0.0, 0.0), yaw=0.1 * number) for number in range(5)])
    assert odometry.yaw == pytest.approx(-0.4)
