from fleet.host.snapshot import Snapshot
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    LogReport,
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
