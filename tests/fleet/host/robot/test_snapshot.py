import pytest

from fleet.host.robot.snapshot import Snapshot
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    LogReport,
    MetricsReport,
    NavigationReport,
    PoseReport,
)


def test_the_newest_of_each_is_kept():
    seen = Snapshot()
    for report in (
        PoseReport(1.0, Vector3(1, 2, 3), Quaternion()),
        BatteryReport(1.0, percent=70.0),
        BatteryReport(2.0, percent=69.0),
        FlightControllerReport(2.0, armed=True, mode="GUIDED", failsafe=False),
        FlightStateReport(3.0, is_flying=True, flight_mode="AUTO"),
        LogReport(4.0, "INFO", "x"),
    ):
        seen.update(report)
    assert (seen.position, seen.battery, seen.armed, seen.mode) == (Vector3(1, 2, 3), 69.0, True, "AUTO")


def test_nothing_is_known_before_the_first_report():
    seen = Snapshot()
    assert (seen.position, seen.battery, seen.armed, seen.mode) == (None, None, None, "")


def test_numbers_for_people_tell_what_is_left_of_the_goal_under_way_and_nothing_after_it():
    seen, plain = Snapshot(), MetricsReport(1.0, navigation={"status": "AUTO"})
    assert seen.with_remaining_distance(plain) == plain
    seen.update(NavigationReport(1.0, "a1", ActionState.RUNNING, 10.0, remaining=7.123, eta=3.0))
    wanted = {"status": "AUTO", "distance_remaining_m": 7.12, "eta_seconds": 3.0}
    assert seen.with_remaining_distance(plain).navigation == wanted
    seen.update(NavigationReport(1.0, "", ActionState.FAILED))  # of another ask, which was refused
    assert seen.with_remaining_distance(plain).navigation == wanted
    seen.update(NavigationReport(1.0, "a1", ActionState.RUNNING, 10.0, "paused", remaining=7.0))
    assert "eta_seconds" not in seen.with_remaining_distance(plain).navigation
    seen.update(NavigationReport(1.0, "a1", ActionState.COMPLETED))
    assert seen.with_remaining_distance(plain) == plain


def pose(stamp, x):
    return PoseReport(stamp, Vector3(x), Quaternion())


def test_the_speed_is_measured_between_poses_by_their_own_stamps():
    seen = Snapshot()
    for tenth in range(11):
        seen.update(pose(10.0 + tenth / 10, 0.2 * tenth))
    assert seen.speed(11.0) == pytest.approx(2.0)


@pytest.mark.parametrize("gap", [3.0, -1.0], ids=["a gap", "a clock set back"])
def test_after_poses_that_say_nothing_of_its_way_the_speed_is_unknown(gap):
    seen = Snapshot()
    for report in (pose(10.0, 0.0), pose(10.5, 1.0), pose(10.5 + gap, 9.0)):
        seen.update(report)
    assert seen.speed(10.5 + gap) is None


def test_a_speed_that_no_pose_tells_any_more_is_unknown():
    seen = Snapshot()
    seen.update(pose(10.0, 0.0))
    seen.update(pose(10.5, 1.0))
    assert seen.speed(10.6) == pytest.approx(2.0)
    assert seen.speed(15.0) is None


def test_the_age_is_since_it_was_heard():
    seen = Snapshot()
    assert seen.age(5.0) is None
    seen.heard = 5.0
    assert seen.age(7.5) == 2.5
