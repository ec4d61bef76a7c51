"""What a vehicle sends by itself, how often, and what it does not send yet."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.manoeuvres import DriveManoeuvre, GoToManoeuvre
from fleet_mavlink.sim.streams import BUILDERS, SimStreams

ACCEPTED, DENIED = 0, 2


def test_only_heartbeats_and_texts_come_unasked(ap):
    ap.run(30)
    assert {m.get_type() for m in ap.heard} == {"HEARTBEAT", "STATUSTEXT", "HOME_POSITION"}
    assert 29 <= len(ap.said("HEARTBEAT")) <= 32


def test_the_ekf_report_shows_a_usable_position(bench):
    ap = bench("ardupilot", ready_after=10.0)
    ap.run(1)
    ap.requests(512, 193)
    assert ap.last("EKF_STATUS_REPORT").flags == 0xA7
    ap.run(10)
    ap.requests(512, 193)
    assert ap.last("EKF_STATUS_REPORT").flags == 0x33F


def test_data_streams_can_be_asked_for(ap):
    ap.run(0.2)
    ap.tell(mav.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    ap.run(10)
    assert 38 <= len(ap.said("ATTITUDE")) <= 42
    assert 38 <= len(ap.said("SYS_STATUS")) <= 42


def test_message_rates(bench):
    ap = bench("ardupilot", step=0.02)
    ap.run(0.2)
    assert ap.requests(511, 30, 20000) == [ACCEPTED]
    assert ap.requests(511, 30, 2500) == [DENIED]
    assert ap.requests(511, 9999, 100000) == [DENIED]
    ap.heard.clear()
    ap.run(10)
    assert 495 <= len(ap.said("ATTITUDE")) <= 505
    ap.requests(511, 30, 0)
    ap.heard.clear()
    ap.run(2)
    assert not ap.said("ATTITUDE")


RATES = {30: 50.0, 0: 1.0, 42: 2.0}


def times(streams, pilot, message, seconds, *, begin=0.0):
    """Return how often a message came in steps of 10 ms."""
    count = 0
    for step in range(1, round(seconds * 100) + 1):
        count += sum(each.id == message for each in streams.due(pilot, begin + step / 100))
    return count


@pytest.mark.parametrize(("message", "rate"), RATES.items())
def test_each_message_comes_at_its_rate(ap, message, rate):
    ap.run(0.2)
    assert times(SimStreams(RATES, 0.0), ap.pilot, message, 10.0) == pytest.approx(10 * rate, abs=2)


def test_a_rate_is_changed_switched_off_and_restored(ap):
    ap.run(0.2)
    streams = SimStreams(RATES, 0.0)
    streams.set(30, 0.5, 0.0)
    assert streams.every(30) == 0.5
    assert times(streams, ap.pilot, 30, 10.0) == pytest.approx(20, abs=1)
    streams.set(30, -1.0, 10.0)
    assert streams.every(30) == 0.0
    assert times(streams, ap.pilot, 30, 10.0, begin=10.0) == 0
    streams.reset(30, 20.0)
    assert streams.every(30) == pytest.approx(0.02)
    streams.reset(193, 20.0)
    assert streams.every(193) == 0.0


def test_what_was_missed_in_a_pause_is_not_sent_in_a_burst(ap):
    ap.run(0.2)
    streams = SimStreams({30: 50.0}, 0.0)
    list(streams.due(ap.pilot, 0.1))
    assert [len(list(streams.due(ap.pilot, 100.0 + step / 1000))) for step in range(5)] == [1, 1, 0, 0, 0]


def test_a_data_stream_is_stopped_again_and_px4_knows_none(ap, bench):
    ap.run(0.2)
    ap.tell(mav.MAVLink_request_data_stream_message(1, 1, 10, 10, 1))
    ap.run(0.5)
    ap.tell(mav.MAVLink_request_data_stream_message(1, 1, 10, 10, 0))
    ap.heard.clear()
    ap.run(1.0)
    assert not ap.said("ATTITUDE")
    px4 = bench("px4", step=0.02)
    px4.run(0.2)
    px4.tell(mav.MAVLink_request_data_stream_message(1, 1, 0, 1, 0))
    px4.heard.clear()
    px4.run(1.0)
    assert len(px4.said("ATTITUDE")) > 40


@pytest.fixture(params=["ardupilot", "px4"])
def moving(request, bench):
    """Let a vehicle fly north-east at 2 m/s and 10 m."""
    it = bench(request.param, home=(47.397742, 8.545594, 488.0, 30.0))
    it.climb()
    it.body.vn, it.body.ve, it.body.vd = 1.2, 1.6, -0.5
    it.body.north, it.body.east, it.body.turn_rate = 100.0, 50.0, 0.25
    return it


def built(it, number):
    return BUILDERS[number](it.pilot)


def test_the_estimate_has_the_units_of_its_message(moving):
    said = built(moving, mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    assert (said.vx, said.vy, said.vz) == pytest.approx((120, 160, -50), abs=1)  # cm/s
    assert said.relative_alt == pytest.approx(10_000, abs=300)  # mm
    assert said.alt == pytest.approx(498_000, abs=300)
    assert said.lat / 1e7 == pytest.approx(47.397742 + 100 / 111_195, abs=1e-5)
    assert said.hdg == pytest.approx(3000, abs=100)  # hundredths of a degree


def test_the_satellite_fix_has_its_speed_and_its_course_over_ground(moving):
    said = built(moving, mav.MAVLINK_MSG_ID_GPS_RAW_INT)
    assert (said.vel, said.cog) == pytest.approx((200, 5313), abs=2)
    assert said.satellites_visible == 10
    assert said.lon / 1e7 == pytest.approx(8.545594 + 50 / 75_270, abs=2e-5)


def test_the_local_position_is_in_metres_and_down(moving):
    said = built(moving, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    assert (said.x, said.y, said.vz) == pytest.approx((100.0, 50.0, -0.5), abs=0.1)
    assert said.z == pytest.approx(-10.0, abs=0.3)


def test_angles_are_radians_and_the_quaternion_is_the_same_attitude(moving):
    moving.body.roll, moving.body.pitch = 0.1, -0.2
    angles = built(moving, mav.MAVLINK_MSG_ID_ATTITUDE)
    assert (angles.roll, angles.pitch, angles.yawspeed) == pytest.approx((0.1, -0.2, 0.25), abs=1e-6)
    q = built(moving, mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION)
    yaw = math.atan2(2 * (q.q1 * q.q4 + q.q2 * q.q3), 1 - 2 * (q.q3**2 + q.q4**2))
    pitch = math.asin(2 * (q.q1 * q.q3 - q.q4 * q.q2))
    roll = math.atan2(2 * (q.q1 * q.q2 + q.q3 * q.q4), 1 - 2 * (q.q2**2 + q.q3**2))
    assert (roll, pitch, yaw) == pytest.approx((angles.roll, angles.pitch, angles.yaw), abs=1e-6)


def test_a_heading_to_the_west_is_negative(moving):
    moving.body.heading = math.radians(270)
    assert built(moving, mav.MAVLINK_MSG_ID_ATTITUDE).yaw == pytest.approx(-math.pi / 2)
    assert built(moving, mav.MAVLINK_MSG_ID_VFR_HUD).heading == 270


def test_the_battery_is_told_alike_in_both_messages(moving):
    status, summary = (
        built(moving, mav.MAVLINK_MSG_ID_BATTERY_STATUS),
        built(moving, mav.MAVLINK_MSG_ID_SYS_STATUS),
    )
    assert status.voltages[0] == summary.voltage_battery == int(moving.pilot.battery.volts * 1000)
    assert set(status.voltages[1:]) == {65535}
    assert status.battery_remaining == summary.battery_remaining
    assert status.current_battery == summary.current_battery > 0


def test_each_autopilot_has_messages_of_its_own(moving):
    of_ardupilot = {mav.MAVLINK_MSG_ID_EKF_STATUS_REPORT, mav.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4}
    of_px4 = {mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS, mav.MAVLINK_MSG_ID_HIGHRES_IMU}
    own, others = (of_ardupilot, of_px4) if moving.ardupilot else (of_px4, of_ardupilot)
    assert all(built(moving, each) is not None for each in own)
    assert all(built(moving, each) is None for each in others)


def test_the_accelerometer_carries_the_vehicle_and_gravity_points_up_in_it(moving):
    moving.body.roll = moving.body.pitch = 0.0
    raw = built(moving, mav.MAVLINK_MSG_ID_RAW_IMU)
    assert (raw.zacc, raw.zgyro) == (-1000, 250)  # thousandths of g and of rad/s
    fine = built(moving, mav.MAVLINK_MSG_ID_HIGHRES_IMU)
    if fine is not None:
        assert (fine.zacc, fine.zgyro) == pytest.approx((-9.81, 0.25))


def test_motors_stand_idle_or_carry_the_vehicle(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    speeds = [built(ap, mav.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4).rpm[0]]
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    speeds.append(built(ap, mav.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4).rpm[0])
    ap.requests(22, 0, 0, 0, 0, 0, 0, 5)
    ap.until(lambda: ap.height > 1.0)
    speeds.append(built(ap, mav.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4).rpm[0])
    assert speeds == [0, 1200, 5200]


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_before_it_has_a_position_what_needs_one_is_not_sent(bench, flavour):
    it = bench(flavour, ready_after=60.0)
    it.run(2.0)
    for number in (
        mav.MAVLINK_MSG_ID_HOME_POSITION,
        mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mav.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    ):
        assert built(it, number) is None
    place = built(it, mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    assert (place.lat, place.lon, place.alt) == (0, 0, 0)
    known = it.pilot.gps.fix  # PX4's receiver has a fix long before its estimator has a position
    assert bool(built(it, mav.MAVLINK_MSG_ID_SYSTEM_TIME).time_unix_usec) is known


def test_the_target_is_told_while_it_has_one(moving):
    moving.pilot.manoeuvre = GoToManoeuvre(10.0, 0.0, -12.0)
    said = built(moving, mav.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT)
    assert said.lat_int / 1e7 == pytest.approx(47.397742 + 10 / 111_195, abs=1e-6)
    assert said.alt == pytest.approx(500.0, abs=0.3)
    moving.pilot.manoeuvre = DriveManoeuvre((1.0, 0.0, 0.0))
    assert built(moving, mav.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT) is None
