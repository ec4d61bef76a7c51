"""PX4 1.16.1 as it was seen on the wire."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, FAILED = 0, 4
NAN = math.nan


def test_texts_are_withheld_until_a_station_is_heard(bench):
    px4 = bench("px4")
    px4.gcs = False
    px4.run(0.2)
    px4.requests(400, 1)
    px4.run(1)
    assert px4.texts == []
    px4.gcs = True
    px4.run(1.5)
    assert px4.texts == ["Armed by external command\t"]


def test_motors_stop_by_themselves_without_a_takeoff(px4):
    px4.run(0.2)
    px4.requests(400, 1)
    assert 10.6 < px4.until(lambda: not px4.pilot.armed) < 11.6


def test_set_mode_gets_one_acknowledgement(px4):
    px4.run(0.2)
    px4.tell(mav.MAVLink_set_mode_message(1, 1, 0x03040000))
    px4.run(0.1)
    assert [ack.command for ack in px4.said("COMMAND_ACK")] == [176]


def test_land_disarms_and_goes_back_to_the_mode_chosen_last(offboard):
    offboard.requests(21)
    assert 12 < offboard.until(lambda: not offboard.pilot.armed) < 24
    assert [text.strip() for text in offboard.texts[-2:]] == ["Landing detected", "Disarmed by landing"]
    assert offboard.mode == "OFFBOARD"


def test_rtl_comes_home(flying):
    flying.requests(192, -1, 1, 0, NAN, 47.397922, 8.545594, 498)
    flying.until(lambda: flying.body.north > 19)
    assert flying.requests(20) == [ACCEPTED]
    assert 30 < flying.until(lambda: not flying.pilot.armed, 80) < 70
    assert abs(flying.body.north) < 1
    assert flying.mode == "LOITER"


def test_a_burst_of_commands_loses_acknowledgements(px4):
    px4.run(0.2)
    for _ in range(20):
        px4.tell(mav.MAVLink_command_long_message(1, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0))
    px4.run(0.1)
    assert len(px4.said("COMMAND_ACK")) == 4
    assert len(px4.said("AUTOPILOT_VERSION")) == 20


def test_commands_for_another_component_get_no_answer(px4):
    px4.run(0.2)
    px4.tell(mav.MAVLink_command_long_message(1, 42, 520, 0, 1, 0, 0, 0, 0, 0, 0))
    px4.run(0.1)
    assert not px4.said("COMMAND_ACK")


def test_the_answer_goes_to_the_asker(px4):
    px4.run(0.2)
    px4.tell(mav.MAVLink_command_long_message(1, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0), system=245, component=191)
    px4.run(0.1)
    ack = px4.last("COMMAND_ACK")
    assert (ack.target_system, ack.target_component) == (245, 191)


def test_rates_come_unasked_and_can_be_changed(bench):
    px4 = bench("px4", step=0.02)
    px4.run(0.2)
    px4.heard.clear()
    px4.run(10)
    assert 480 <= len(px4.said("ATTITUDE")) <= 505
    assert px4.requests(511, 30, 100000) == [ACCEPTED]
    assert px4.requests(511, 9999, 100000) == [FAILED]
    px4.heard.clear()
    px4.run(10)
    assert 98 <= len(px4.said("ATTITUDE")) <= 102


def test_a_pilot_takes_over_and_holds(offboard):
    offboard.vehicle.set_fault("pilot_takeover", 1)
    offboard.stream(3, 2.0)
    assert offboard.mode == "POSCTL"
    assert offboard.height == pytest.approx(10, abs=0.3)
    assert offboard.body.speed < 0.1
