"""The mission protocol and the flight of a mission, on both flavours."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.missions import NO_MISSION, NOT_STARTED
from tests.adapters.fleet_mavlink.sim.mission_plans import LON, item, plan, start, upload


def test_what_was_uploaded_comes_back(loaded):
    (count,) = loaded.tell(mav.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == len(plan(ardupilot=loaded.ardupilot))
    (got,) = loaded.tell(mav.MAVLink_mission_request_int_message(1, 1, count.count - 2, 0))
    assert (got.command, got.y, got.z) == (16, LON + 2000, 10.0)
    assert got.frame == (3 if loaded.ardupilot else 6)


def test_ardupilots_item_0_is_home(bench):
    ap = bench("ardupilot")
    upload(ap, plan(ardupilot=True))
    (got,) = ap.tell(mav.MAVLink_mission_request_int_message(1, 1, 0, 0))
    assert (got.frame, got.command, got.z) == (0, 16, pytest.approx(488, abs=0.1))


def test_a_running_mission_is_cleared_only_by_px4(loaded):
    start(loaded)
    (ack,) = loaded.tell(mav.MAVLink_mission_clear_all_message(1, 1, 0))
    assert ack.type == (mav.MAV_MISSION_ERROR if loaded.ardupilot else mav.MAV_MISSION_ACCEPTED)


def test_clearing_forgets_the_mission(loaded):
    loaded.tell(mav.MAVLink_mission_clear_all_message(1, 1, 0))
    assert loaded.pilot.missions.state == NO_MISSION
    assert not loaded.pilot.missions.loaded


def test_a_missing_item_is_asked_for_again_and_at_last_given_up(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    ap.tell(mav.MAVLink_mission_count_message(1, 1, 2, 0))
    ap.run(9)
    assert 7 <= len(ap.said("MISSION_REQUEST")) <= 9
    assert ap.last("MISSION_ACK").type == mav.MAV_MISSION_OPERATION_CANCELLED


def test_ardupilot_tells_a_repeated_item_and_goes_on(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    ap.tell(mav.MAVLink_mission_count_message(1, 1, 2, 0))
    ap.tell(item(0, 16))
    (ack,) = ap.tell(item(0, 16))
    assert ack.type == mav.MAV_MISSION_INVALID_SEQUENCE
    (denied,) = ap.tell(mav.MAVLink_mission_request_list_message(1, 1, 0))
    assert denied.type == mav.MAV_MISSION_DENIED
    (done,) = ap.tell(item(1, 22))
    assert done.type == mav.MAV_MISSION_ACCEPTED
    assert ap.pilot.missions.state == NOT_STARTED


def test_px4_says_nothing_to_a_repeated_item(bench):
    px4 = bench("px4")
    px4.run(0.2)
    px4.tell(mav.MAVLink_mission_count_message(1, 1, 2, 0))
    px4.tell(item(0, 22))
    assert px4.tell(item(0, 22)) == []


def test_navigation_that_cannot_be_flown_is_refused(bench):
    px4 = bench("px4")
    px4.run(0.2)
    px4.tell(mav.MAVLink_mission_count_message(1, 1, 1, 0))
    (ack,) = px4.tell(item(0, 36))
    assert ack.type == mav.MAV_MISSION_UNSUPPORTED


def test_the_old_float_item_is_understood(bench):
    ap = bench("ardupilot")
    ap.run(0.2)
    ap.tell(mav.MAVLink_mission_count_message(1, 1, 1, 0))
    old = mav.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 47.5, 8.5, 10, 0)
    (ack,) = ap.tell(old)
    assert ack.type == 0
    assert ap.pilot.missions.items[0].x == pytest.approx(475000000, abs=20)


def test_the_mission_survives_a_reboot(loaded):
    loaded.vehicle.set_fault("reboot", 1)
    loaded.run(3)
    assert loaded.pilot.missions.state == NOT_STARTED
    assert loaded.pilot.missions.loaded
