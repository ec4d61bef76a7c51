"""What a vehicle carries: inertial sensors, motors, gimbal; nothing is told that is not known."""

import math

import pytest

from fleet.model.report import ImuReport, JointReport, MetricsReport, PoseReport
from fleet_mavlink.onboard_sensors import OnboardSensors, reduce_sensors
from fleet_mavlink.payload_messages import (
    GimbalDeviceAttitudeStatus,
    HighresImu,
    RawImu,
)

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


def after(message, now=1.0):
    return reduce_sensors(OnboardSensors(), message, now)


def test_ardupilots_thousandths_become_si():
    imu = after(RawImu(0, 0, -1000, 100, 0, -500)).imu
    assert imu.accel.z == pytest.approx(-9.80665)
    assert (imu.gyro.x, imu.gyro.z) == (0.1, -0.5)


@pytest.mark.parametrize(
    "message", [HighresImu(0, 0, -9.8, 0, 0, 0, 0x07), HighresImu(math.nan, 0, 0, 0, 0, 0, 0x3F)]
)
def test_half_a_measurement_is_none(message):
    assert after(message).imu is None


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0)])
def test_a_gimbal_that_tells_no_rotation_is_not_known(q):
    assert after(GimbalDeviceAttitudeStatus(12, q)).aim is None


def test_a_gimbal_that_looks_down_has_a_negative_pitch():
    turned = (math.cos(-math.pi / 8), 0.0, math.sin(-math.pi / 8), 0.0)
    aim = after(GimbalDeviceAttitudeStatus(12, turned)).aim
    assert (aim.pitch, aim.yaw) == (pytest.approx(-45.0), pytest.approx(0.0))


@both
def test_rates_and_acceleration_are_reported_in_the_bodys_frame(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, rates={"imu": 20.0}) as it:
            await it.wait_until_known()
            await it.until(lambda: it.robot.reports_of(ImuReport))
            report = it.robot.reports_of(ImuReport)[-1]
            assert report.accel.z == pytest.approx(9.81, abs=0.05)
            before = len(it.robot.reports_of(ImuReport))
            await it.until(lambda: len(it.robot.reports_of(ImuReport)) >= before + 40, within=4.0)

    run_in_sim_time(main())


def test_motors_are_the_joints_that_the_config_names(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", motor_joints=["m1", "m2", "m3", "m4"]) as it:
            await it.wait_until_known()
            await it.do("arm")
            await it.until(lambda: it.robot.reports_of(JointReport)[-1].velocities["m4"] > 100.0)

    run_in_sim_time(main())


def test_a_position_that_is_not_reported_any_more_is_not_reported_again(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.until(lambda: it.robot.reports_of(PoseReport))
            it.sim.pilot.streams.set = lambda *_: None
            it.sim.pilot.streams._due.pop(33)
            await it.until(lambda: it.now - it.state.position_at + it._origin > 2.0)
            before = len(it.robot.reports_of(PoseReport))
            await it.until(lambda: len(it.robot.reports_of(MetricsReport)) > 3)
            assert len(it.robot.reports_of(PoseReport)) == before

    run_in_sim_time(main())


def test_what_went_wrong_on_the_link_is_counted_and_reported(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", faults={"corrupt": 0.2}) as it:
            await it.wait_until_known()
            await it.until(lambda: it.robot.reports_of(MetricsReport))
            await it.until(lambda: it.robot.reports_of(MetricsReport)[-1].errors)
            (error,) = it.robot.reports_of(MetricsReport)[-1].errors
            assert "checksum" in error["type"]
            assert error["count"] > 0

    run_in_sim_time(main())
