"""The schedule of reports: each at its rate, changes at once, and of a lost vehicle nothing but its loss."""

from types import SimpleNamespace

import pytest

from fleet import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    GeoOrigin,
    GpsReport,
    ImuReport,
    JointReport,
    LogReport,
    MetricsReport,
    PoseReport,
    TelemetryReport,
)
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.messages import Attitude, ExtendedSysState, GlobalPositionInt, GpsRawInt, SysStatus
from fleet_mavlink.payload_messages import EscTelemetry1To4, HighresImu
from fleet_mavlink.reporter import Reporter
from fleet_mavlink.statustext import Sentence

HOME = GeoOrigin(47.397742, 8.545594, 488.0)
BASICS = {
    "name": "kestrel",
    "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f",
    "adapter": "mavlink",
    "link": "memory:kestrel",
}


def position(relative=12_000):
    return GlobalPositionInt(1, 473_977_420, 85_455_940, 500_000, relative, 0, 0, 0, 9000)


def battery(percent=80):
    return SysStatus(0, 15_200, 100, percent)


class Told:
    """A reporter on a clock of its own; ``pass_time`` makes the calls that are due in it."""

    def __init__(self, harness, **config):
        self.it = harness("px4")
        self.reports, self.calls, self.counts, self.origin = [], [], {}, HOME
        self.clock = self.it.clock
        robot = SimpleNamespace(clock=self.clock, report=self.reports.append, every=self._every)
        checked = MavlinkConfig.model_validate(BASICS | config)
        self.reporter = Reporter(self.it.vehicle, checked, robot, lambda: self.origin, lambda: self.counts)
        self.reporter.begin()

    def _every(self, seconds, call):
        self.calls.append([seconds, self.clock.monotonic() + seconds, call])

    def pass_time(self, seconds, *, beats=True):
        """Let time pass in steps of 10 ms, with a heartbeat each half second."""
        for step in range(round(seconds * 100)):
            if beats and step % 50 == 0:
                self.it.beat()
            self.clock.advance(0.01)
            for call in self.calls:
                if self.clock.monotonic() >= call[1] - 1e-6:
                    call[1] += call[0]
                    call[2]()

    def of(self, kind):
        return [report for report in self.reports if isinstance(report, kind)]


@pytest.fixture
def told(harness):
    return lambda **config: Told(harness, **config)


def flies(it):
    """Let a vehicle say everything that is reported."""
    it.it.beat()
    it.it.receive(
        position(),
        Attitude(1, 0.1, 0.0, 1.0),
        battery(),
        ExtendedSysState(2, 0),
        HighresImu(0.0, 0.0, -9.8, 0.0, 0.0, 0.5, 0x3F),
        EscTelemetry1To4((6000, 6000, 6000, 6000)),
    )


@pytest.mark.parametrize(
    ("kind", "rates", "count"),
    [
        (BatteryReport, {"battery": 0.5}, 4),
        (FlightStateReport, {"state": 1.0}, 8),
        (MetricsReport, {"metrics": 2.0}, 16),
    ],
)
def test_each_report_comes_at_its_rate(told, kind, rates, count):
    it = told(rates=rates)
    flies(it)
    it.pass_time(8.0)
    assert len(it.of(kind)) == count


def test_motion_is_reported_while_it_is_fresh_and_not_again_with_a_new_time(told):
    it = told(rates={"pose": 10.0, "imu": 5.0})
    flies(it)
    it.pass_time(0.9)
    assert (len(it.of(PoseReport)), len(it.of(ImuReport))) == (9, 4)
    it.pass_time(5.0)
    assert len(it.of(PoseReport)) <= 11
    assert len(it.of(ImuReport)) <= 6


def test_without_an_origin_there_is_no_pose_and_all_else(told):
    it = told()
    it.origin = None
    flies(it)
    it.pass_time(1.0)
    assert not it.of(PoseReport)
    assert it.of(ImuReport)


def test_reports_that_are_switched_off_are_not_scheduled(told):
    it = told(rates={"imu": 0.0, "motors": 0.0}, motor_joints=["a"])
    flies(it)
    it.pass_time(2.0)
    assert not it.of(ImuReport) + it.of(JointReport)
    told(rates={"imu": 0.0})
    motors = told(motor_joints=["a", "b"])
    flies(motors)
    motors.pass_time(2.0)
    assert {tuple(report.positions) for report in motors.of(JointReport)} == {("a", "b")}


def test_a_lost_fix_is_reported_as_none(told):
    it = told()
    it.it.beat()
    it.it.receive(GpsRawInt(3, 473_977_420, 85_455_940, 500_000, 12, 900, 1500))
    it.pass_time(1.5)
    it.it.receive(GpsRawInt(1, 0, 0, 0, 2, 0, 0))
    it.pass_time(1.0)
    assert [report.fix_type for report in it.of(GpsReport)] == ["3d", "none"]


def test_of_a_vehicle_that_was_never_heard_nothing_is_reported(told):
    it = told()
    it.pass_time(10.0, beats=False)
    assert it.reports == []
    assert not it.reporter.battery()


def test_of_a_lost_vehicle_only_its_loss_is_reported_and_that_again_and_again(told):
    it = told()
    flies(it)
    it.pass_time(2.0)
    it.reports.clear()
    it.pass_time(3.5, beats=False)
    (loss,) = [report for report in it.of(FlightControllerReport) if not report.connected]
    it.reports.clear()
    it.pass_time(10.0, beats=False)
    assert {type(report) for report in it.reports} == {FlightControllerReport}
    assert [report.connected for report in it.reports] == [False, False]
    assert loss.system_id == 1


def test_a_changed_state_is_reported_within_a_fifth_of_a_second_and_an_unchanged_one_every_five(told):
    it = told()
    it.pass_time(0.3)
    assert len(it.of(FlightControllerReport)) == 1
    it.pass_time(4.5)
    assert len(it.of(FlightControllerReport)) == 1
    it.pass_time(1.0)
    assert len(it.of(FlightControllerReport)) == 2
    it.it.beat(mode=0x06040000)
    it.pass_time(0.21, beats=False)
    assert it.of(FlightControllerReport)[-1].mode == "AUTO.LAND"
    assert len(it.of(FlightControllerReport)) == 3


def test_a_height_alone_is_reported_once_a_second_and_anything_else_at_once(told):
    it = told()
    flies(it)
    it.pass_time(0.3)
    before = len(it.of(TelemetryReport))
    for height in range(9):
        it.it.receive(position(height * 1000))
        it.pass_time(0.2, beats=height % 3 == 0)
    assert 1 <= len(it.of(TelemetryReport)) - before <= 3
    before = len(it.of(TelemetryReport))
    it.it.beat(armed=True)
    it.pass_time(0.21, beats=False)
    assert len(it.of(TelemetryReport)) == before + 1
    assert it.of(TelemetryReport)[-1].fields["armed"] is True


def test_the_last_eight_texts_are_part_of_its_state(told):
    it = told()
    it.it.beat()
    it.it.vehicle._say([Sentence(f"text {number}", 6, float(number)) for number in range(12)])
    it.pass_time(0.3)
    said = [text.text for text in it.of(FlightControllerReport)[-1].status_texts]
    assert said == [f"text {number}" for number in range(4, 12)]


def test_a_battery_is_reported_on_request_once_it_is_known(told):
    it = told()
    it.it.beat()
    assert not it.reporter.battery()
    it.it.receive(battery(61))
    assert it.reporter.battery()
    (report,) = it.reports
    assert (report.percent, report.stamp) == (61.0, it.clock.time())


def test_a_text_is_reported_with_the_wall_clocks_time(told):
    it = told()
    it.reporter.report_text(Sentence("Crash detected", 2, 5.0))
    (report,) = it.reports
    assert isinstance(report, LogReport)
    assert (report.message, report.level, report.stamp) == ("Crash detected", "CRITICAL", it.clock.time())


def test_errors_that_were_counted_are_in_the_metrics(told):
    it = told()
    it.counts = {"frames lost": 3, "bad frames": 0}
    it.pass_time(2.1)
    assert it.of(MetricsReport)[-1].errors == ({"type": "frames lost", "count": 3},)
