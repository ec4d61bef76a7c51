"""Commands that both autopilots execute alike: rates, single messages, the gimbal."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.gimbal import SimGimbal

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
ATTITUDE, HEARTBEAT, GIMBAL = 30, 0, 280
SET_RATE, GET_RATE, REQUEST, VERSION = 511, 510, 512, 520
CONFIGURE, TURN = 1001, 1000


@pytest.fixture(params=["ardupilot", "px4"])
def it(request, bench):
    made = bench(request.param)
    made.run(0.2)
    return made


def rate_of(it, message):
    """Ask for the interval of a message, microseconds."""
    assert it.requests(GET_RATE, message) == [ACCEPTED]
    answer = it.last("MESSAGE_INTERVAL")
    assert answer.message_id == message
    return answer.interval_us


def heard(it, kind, seconds):
    it.heard.clear()
    it.run(seconds)
    return len(it.said(kind))


def test_an_interval_is_in_microseconds_and_read_back(it):
    assert it.requests(SET_RATE, ATTITUDE, 100_000) == [ACCEPTED]
    assert rate_of(it, ATTITUDE) == 100_000
    assert heard(it, "ATTITUDE", 5.0) == pytest.approx(50, abs=2)


def test_minus_one_switches_a_message_off_and_zero_restores_its_own_rate(it):
    before = rate_of(it, HEARTBEAT)
    assert it.requests(SET_RATE, HEARTBEAT, -1) == [ACCEPTED]
    assert rate_of(it, HEARTBEAT) == -1
    assert heard(it, "HEARTBEAT", 3.0) == 0
    assert it.requests(SET_RATE, HEARTBEAT, 0) == [ACCEPTED]
    assert rate_of(it, HEARTBEAT) == before == 1_000_000
    assert heard(it, "HEARTBEAT", 3.0) == 3


def test_a_message_that_is_not_sent_has_the_interval_minus_one(it):
    assert rate_of(it, 9999) == -1
    assert rate_of(it, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == -1


def test_the_version_is_told_on_request(it):
    assert it.requests(VERSION, 1) == [ACCEPTED]
    told = it.last("AUTOPILOT_VERSION")
    assert told.capabilities == it.pilot.capabilities
    assert told.flight_sw_version == it.pilot.version


def test_a_single_message_is_told_on_request_and_an_unknown_one_is_not(it):
    assert it.requests(REQUEST, ATTITUDE) == [ACCEPTED]
    assert it.said("ATTITUDE")
    assert it.requests(REQUEST, 9999) == [FAILED if it.ardupilot else DENIED]
    assert it.requests(REQUEST, math.nan) == [FAILED if it.ardupilot else DENIED]


def test_without_a_gimbal_each_refuses_in_its_own_way(it):
    assert it.requests(CONFIGURE, 255, 190) == it.requests(TURN, -10.0, 0.0)
    assert it.pilot.without_gimbal != ACCEPTED
    assert it.requests(REQUEST, GIMBAL) in ([FAILED], [DENIED])
    assert not it.said("GIMBAL_MANAGER_INFORMATION")


def test_with_a_gimbal_the_station_in_control_turns_it(it):
    gimbal = it.vehicle.equipment.gimbal = SimGimbal()
    assert it.requests(REQUEST, GIMBAL) == [ACCEPTED]
    assert it.said("GIMBAL_MANAGER_INFORMATION")
    assert it.requests(TURN, -30.0, 0.0, math.nan, math.nan) == [DENIED]
    assert it.requests(CONFIGURE, 255, 190, -1, -1) == [ACCEPTED]
    assert it.requests(TURN, -30.0, 0.0, math.nan, math.nan) == [ACCEPTED]
    it.run(1.0)
    assert gimbal.pitch == pytest.approx(-30.0)
