from fleet.host.snapshot import Snapshot
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
        seen.take(report)
    assert (seen.position, seen.battery, seen.armed, seen.mode) == (Vector3(1, 2, 3), 69.0, True, "AUTO")


def test_nothing_is_known_before_the_first_report():
    seen = Snapshot()
    assert (seen.position, seen.battery, seen.armed, seen.mode) == (None, None, None, "")


def test_numbers_for_people_tell_what_is_left_of_the_goal_under_way_and_nothing_after_it():
    seen, plain = Snapshot(), MetricsReport(1.0, navigation={"status": "AUTO"})
    assert seen.with_way(plain) == plain
    seen.take(NavigationReport(1.0, "a1", ActionState.RUNNING, 10.0, remaining=7.123, eta=3.0))
    wanted = {"status": "AUTO", "distance_remaining_m": 7.12, "eta_seconds": 3.0}
    assert seen.with_way(plain).navigation == wanted
    seen.take(NavigationReport(1.0, "", ActionState.FAILED))  # of another ask, which was refused
    assert seen.with_way(plain).navigation == wanted
    seen.take(NavigationReport(1.0, "a1", ActionState.RUNNING, 10.0, "paused", remaining=7.0))
    assert "eta_seconds" not in seen.with_way(plain).navigation
    seen.take(NavigationReport(1.0, "a1", ActionState.COMPLETED))
    assert seen.with_way(plain) == plain
