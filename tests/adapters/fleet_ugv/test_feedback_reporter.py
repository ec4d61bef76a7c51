"""What is told of a base: pose, joints, battery and metrics, each as often as it should be."""

import math

import pytest

from fleet import BatteryReport, ImuReport, JointReport, PoseReport, Vector3
from fleet_ugv.config import UgvConfig
from fleet_ugv.feedback_reporter import FeedbackReporter
from fleet_ugv.model import Feedback
from fleet_ugv.odometry import Scale, WheelOdometry

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


def observer(profile="ros-arduino", **more):
    basics = {"name": "rover", "twin": TWIN, "adapter": "ugv", "profile": profile, "link": f"sim:{profile}"}
    config = UgvConfig.model_validate(basics | more)
    return FeedbackReporter(
        config, WheelOdometry(Scale(track=0.2, left=2.0), 1.0)
    ), config.setting.diameter / 2


@pytest.fixture
def it():
    return observer()[0]


def told(it, feedback, now, stamp=7.0):
    """Take a feedback, and return the reports after it by their kind."""
    it.update(feedback, now)
    return {type(report): report for report in it.reports(feedback, now, stamp)}


def test_a_pose_is_told_with_each_feedback_at_its_time(it):
    for now in (1.0, 1.02, 1.04):
        report = told(it, Feedback(distances=(0.0, 0.0)), now, stamp=100.0 + now)[PoseReport]
        assert (report.stamp, report.position) == (100.0 + now, Vector3())


def test_joints_are_told_at_most_ten_times_a_second(it):
    times = [round(1.0 + 0.03 * cycle, 2) for cycle in range(17)]
    seen = [now for now in times if JointReport in told(it, Feedback(distances=(0.0, 0.0)), now)]
    assert seen == [1.0, 1.12, 1.24, 1.36, 1.48]


def test_wheels_turn_by_the_calibrated_distance_over_their_radius():
    it, radius = observer()
    it.update(Feedback(distances=(0.0, 0.0)), 1.0)
    joints = told(it, Feedback(distances=(0.01, 0.02), speeds=(0.1, 0.2)), 1.1)[JointReport]
    assert joints.positions == pytest.approx({"left_wheel": 0.02 / radius, "right_wheel": 0.02 / radius})
    assert joints.velocities == pytest.approx({"left_wheel": 0.2 / radius, "right_wheel": 0.2 / radius})


def test_speeds_that_a_base_does_not_tell_are_left_out(it):
    assert told(it, Feedback(distances=(0.0, 0.0)), 1.0)[JointReport].velocities == {}


def test_the_mount_is_where_it_says_or_else_where_it_was_sent(it):
    plain = Feedback(distances=(0.0, 0.0))
    assert set(told(it, plain, 1.0)[JointReport].positions) == {"left_wheel", "right_wheel"}
    it.camera = (0.5, -0.2)
    positions = told(it, plain, 2.0)[JointReport].positions
    assert (positions["pan"], positions["tilt"], it.mount) == (0.5, -0.2, None)
    measured = Feedback(distances=(0.0, 0.0), pan=0.4, tilt=-0.1)
    positions = told(it, measured, 3.0)[JointReport].positions
    assert (positions["pan"], positions["tilt"], it.mount) == (0.4, -0.1, (0.4, -0.1))
    half = told(it, Feedback(distances=(0.0, 0.0), pan=1.0), 4.0)[JointReport].positions
    assert (half["pan"], it.mount) == (0.5, (0.4, -0.1)), "half a measurement is none"


def test_an_imu_is_told_beside_the_joints_if_it_is_whole(it):
    whole = Feedback(distances=(0.0, 0.0), gyro=Vector3(0.1, 0.2, 0.3), accel=Vector3(0.0, 0.0, 9.8))
    imu = told(it, whole, 1.0)[ImuReport]
    assert (imu.gyro, imu.accel) == (Vector3(0.1, 0.2, it.odometry.level(0.3)), Vector3(0.0, 0.0, 9.8))
    assert ImuReport not in told(it, whole, 1.02)
    for half in ({"gyro": Vector3()}, {"accel": Vector3()}):
        assert ImuReport not in told(it, Feedback(distances=(0.0, 0.0), **half), 3.0 + len(half))


def test_the_rate_of_the_imu_is_without_the_bias_that_was_learned(it):
    still = Feedback(distances=(0.0, 0.0), speeds=(0.0, 0.0), gyro=Vector3(0.0, 0.0, 0.01), accel=Vector3())
    for cycle in range(200):
        it.update(still, 1.0 + 0.02 * cycle)
    assert told(it, still, 5.02)[ImuReport].gyro.z == pytest.approx(0.0, abs=1e-6)


def test_the_battery_is_told_every_two_seconds_once_it_is_known(it):
    assert BatteryReport not in told(it, Feedback(), 1.0)
    assert told(it, Feedback(voltage=11.4), 1.1)[BatteryReport].voltage == 11.4
    assert BatteryReport not in told(it, Feedback(voltage=11.4), 3.0)
    assert told(it, Feedback(), 3.1)[BatteryReport].voltage == 11.4, "the last one, if none is in it"


def test_percents_are_those_of_the_configured_curve_or_unknown():
    it, _ = observer(battery=[(10.0, 0.0), (12.0, 100.0)])
    assert it.battery(7.0) == BatteryReport(7.0, percent=None, voltage=None)
    it.update(Feedback(voltage=11.5), 1.0)
    assert it.battery(7.0) == BatteryReport(7.0, percent=75.0, voltage=11.5)


def test_metrics_are_due_once_a_second(it):
    assert [now for now in (1.0, 1.5, 1.99, 2.0, 2.5, 3.1) if it.metrics_due(now)] == [1.0, 2.0, 3.1]


def test_metrics_have_what_is_known(it):
    errors = ({"type": "checksum", "count": 3},)
    metrics = it.metrics(7.0, errors)
    assert (metrics.stamp, metrics.power, metrics.errors) == (7.0, {}, errors)
    assert metrics.navigation == {
        "speed": 0.0,
        "yaw_rate": 0.0,
        "position_sigma_m": 0.0,
        "heading_sigma_rad": 0.0,
    }


def test_metrics_have_the_measured_motion_and_temperature():
    it, _ = observer(battery=[(10.0, 0.0), (12.0, 100.0)])
    it.update(Feedback(distances=(0.0, 0.0)), 1.0)
    it.update(Feedback(distances=(0.01, 0.04), voltage=11.0, temperature=41.5), 1.1)
    metrics = it.metrics(7.0, ())
    assert metrics.power == {"battery_percent": 50.0, "voltage": 11.0, "temperature": 41.5}
    assert metrics.navigation["speed"] == pytest.approx((0.02 + 0.04) / 2 / 0.1)
    assert metrics.navigation["yaw_rate"] == pytest.approx(0.02 / 0.2 / 0.1)
    assert metrics.navigation["position_sigma_m"] == round(it.odometry.position_sigma, 3)
    assert metrics.navigation["heading_sigma_rad"] > 0.0


def test_a_temperature_that_is_not_told_any_more_is_unknown(it):
    it.update(Feedback(temperature=41.5), 1.0)
    it.update(Feedback(), 1.1)
    assert "temperature" not in it.metrics(7.0, ()).power


def test_what_gives_no_motion_leaves_the_last_one(it):
    it.update(Feedback(distances=(0.0, 0.0)), 1.0)
    assert it.update(Feedback(distances=(0.01, 0.02)), 1.1).speed == it.speed
    speed = it.speed
    assert it.update(Feedback(distances=(50.0, 50.0)), 1.2) is None, "a jump"
    assert (it.speed, math.isfinite(it.yaw_rate)) == (speed, True)
