"""A recorded dog reports again what its frames say, when they said it, and sends nothing."""

import asyncio

import pytest

from fleet import BatteryReport, CanFrame, ImuReport, JointReport
from fleet.errors import LinkLost
from fleet.link.tap import LinkFrame
from fleet.link.url import OPENER
from fleet.replay.recorded_links import RecordedLinks
from fleet.testing.robot import RecordingRobot
from fleet_quadruped.drives.cia402.frames import TPDO1, CountUnits
from fleet_quadruped.frames import encode
from fleet_quadruped.recorded import CHANNELS, RecordedDog
from fleet_quadruped.robot.names import JOINTS
from tests.adapters.fleet_quadruped.conftest import config

LEVEL = {
    "qw": 1.0,
    "qx": 0.0,
    "qy": 0.0,
    "qz": 0.0,
    "gx": 0.1,
    "gy": 0.2,
    "gz": 0.3,
    "ax": 0.5,
    "ay": -0.5,
    "az": 9.81,
}


class Bench:
    """A recorded dog and its bus, over which a test has the frames come."""

    def __init__(self, dog):
        self.dog, self.robot = dog, RecordingRobot("rex")
        self.links = RecordedLinks(("a",))
        self.adapter = RecordedDog(config(), self.robot, dog)

    async def connect(self):
        OPENER.set(self.links.open)
        await self.adapter.connect()
        return self

    def hear(self, identifier, data):
        self.raw(CanFrame(identifier, data).packed())

    def raw(self, data):
        self.links._open["a"].arrive(LinkFrame(0.0, "in", data))

    def answers(self, angle=0.5, numbers=range(12)):
        for number in numbers:
            joint = self.dog.all_joints[number]
            self.hear(TPDO1 + joint.id, CountUnits(joint).pack(0x1237, angle, 2.0))

    def imu(self, **changes):
        for frame in self.dog.imu.frames:
            self.hear(frame.id, encode(frame, LEVEL | changes))

    def battery(self, percent=80.0, voltage=48.0):
        (frame,) = self.dog.battery.frames
        self.hear(frame.id, encode(frame, {"percent": percent, "voltage": voltage, "current": 3.0}))


@pytest.fixture
async def bench(dog):
    return await Bench(dog).connect()


async def test_joints_are_reported_once_all_of_them_have_been_measured(bench):
    bench.answers(numbers=range(11))
    assert bench.robot.reports == []
    bench.answers(numbers=[11])
    (report,) = bench.robot.reports_of(JointReport)
    assert tuple(report.positions) == JOINTS
    assert list(report.positions.values()) == pytest.approx([0.5] * 12, abs=1e-4)
    assert list(report.efforts.values()) == pytest.approx([2.0] * 12, abs=0.01)


async def test_each_measurement_is_reported_once(bench):
    bench.answers(0.5)
    bench.robot.clock.advance(0.01)
    bench.answers(0.6, range(11))
    assert len(bench.robot.reports) == 1
    bench.answers(0.6, [11])
    assert len(bench.robot.reports) == 2
    assert set(bench.robot.reports[-1].velocities.values()) != {0.0}


async def test_a_report_has_the_time_of_its_oldest_measurement(bench):
    first = bench.robot.clock.time()
    bench.answers(numbers=range(6))
    bench.robot.clock.advance(0.005)
    bench.answers(numbers=range(6, 12))
    assert bench.robot.reports[0].stamp == pytest.approx(first, abs=1e-5)


async def test_an_imu_is_reported_from_its_attitude_and_rates_on(bench):
    attitude, rates, accelerations = bench.dog.imu.frames
    bench.hear(attitude.id, encode(attitude, LEVEL))
    assert bench.robot.reports == []
    bench.hear(rates.id, encode(rates, LEVEL))
    bench.robot.clock.advance(0.001)
    bench.hear(accelerations.id, encode(accelerations, LEVEL))
    report = bench.robot.reports_of(ImuReport)[-1]
    assert report.stamp == bench.robot.clock.time()
    assert (report.gyro.x, report.gyro.y, report.gyro.z) == pytest.approx((0.1, 0.2, 0.3))
    assert (report.accel.x, report.accel.y, report.accel.z) == pytest.approx((0.5, -0.5, 9.81), abs=0.005)


async def test_an_imu_without_an_attitude_is_not_reported(bench):
    bench.imu(qw=0.0)
    assert bench.robot.reports == []


async def test_the_battery_is_reported_once_a_second_while_it_is_fresh(bench):
    bench.robot.advance(1.0)
    assert bench.robot.reports == []
    bench.battery(percent=55.0)
    assert bench.robot.reports == []
    bench.robot.advance(4.0)
    reports = bench.robot.reports_of(BatteryReport)
    assert [(report.percent, report.voltage, report.current) for report in reports] == [(55.0, 48.0, 3.0)] * 4
    bench.robot.advance(3.0)
    assert len(bench.robot.reports) == 4


async def test_an_invalid_value_of_the_battery_is_left_out(bench):
    bench.battery(percent=255.0)
    bench.robot.advance(1.0)
    (report,) = bench.robot.reports_of(BatteryReport)
    assert (report.percent, report.voltage) == (None, 48.0)


async def test_a_dog_without_sensors_is_its_joints_alone(dog):
    bench = await Bench(dog.model_copy(update={"imu": None, "battery": None})).connect()
    for number in (0x110, 0x111, 0x112, 0x361):
        bench.hear(number, bytes(8))
    bench.answers()
    bench.robot.advance(2.0)
    assert [type(report) for report in bench.robot.reports] == [JointReport]


@pytest.mark.parametrize(
    "data", [b"", b"\x00", CanFrame(0x7FF, b"").packed(), CanFrame(0x181, b"\x37").packed()]
)
async def test_what_is_no_frame_of_the_dog_is_ignored(bench, data):
    bench.raw(data)
    assert bench.robot.reports == []


async def test_nothing_is_sent_and_it_runs_until_its_bus_is_opened_anew(bench):
    run = asyncio.create_task(bench.adapter.run())
    bench.answers()
    await bench.adapter.stop("stop")
    bench.adapter.halt()
    await asyncio.sleep(0)
    assert bench.links._open["a"].stats.sent == 0
    assert not run.done()
    bench.links._open["a"].fall("the recording begins anew")
    with pytest.raises(LinkLost):
        await run


async def test_a_bus_without_frames_is_said(dog):
    bench = Bench(dog)
    bench.links = RecordedLinks(("can1",))
    with pytest.raises(LinkLost, match="the recording has no frames of it"):
        await bench.connect()


def test_what_follows_from_the_frames_is_compared():
    assert {kind.channel for kind in (JointReport, ImuReport, BatteryReport)} == CHANNELS
