"""ArduRover 4.6.3 as it was recorded: ap_rover and ap_rover_stops."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
MANUAL, HOLD, LOITER, RTL, GUIDED = 0, 4, 5, 11, 15
AHEAD, KEEP = 0x0DC7, 0x05C7  # masks: velocity; velocity and rate of turn


def stopped_after(it, speed=0.1):
    """Let it stop; return metres and seconds."""
    north, east = it.body.north, it.body.east
    took = it.until(lambda: it.body.speed <= speed, limit=12.0)
    return math.hypot(it.body.north - north, it.body.east - east), took


def test_it_says_what_it_is(rover):
    beat = rover.last("HEARTBEAT")
    assert (beat.type, beat.autopilot, beat.custom_mode) == (10, 3, GUIDED)
    rover.run(1.1)
    assert rover.last("HEARTBEAT").base_mode == 0x89


def test_it_starts_in_manual_after_it_was_initialising(bench):
    it = bench("ardupilot", vehicle="rover", ready_after=None)
    it.run(1.5)
    assert it.last("HEARTBEAT").custom_mode == 16
    assert it.last("HEARTBEAT").system_status == 2
    it.run(2.5)
    assert it.last("HEARTBEAT").custom_mode == MANUAL


def test_it_neither_takes_off_nor_lands_nor_pauses(rover):
    assert rover.requests(22, 0, 0, 0, 0, 0, 0, 10) == [UNSUPPORTED]
    assert rover.requests(21) == [UNSUPPORTED]
    assert rover.requests(193, 0) == [UNSUPPORTED]
    assert rover.requests(176, 0, GUIDED) == [DENIED]
    assert rover.requests(176, 1, 99) == [FAILED]
    assert "No such mode 99" in rover.texts


def test_its_landed_state_is_never_reported_and_its_height_is_that_of_the_sea(rover):
    rover.requests(512, 245)
    assert rover.last("EXTENDED_SYS_STATE").landed_state == 0
    rover.requests(512, 33)
    assert rover.last("GLOBAL_POSITION_INT").relative_alt / 1000 == pytest.approx(487.9, abs=0.2)
    assert rover.requests(400, 0) == [ACCEPTED]
    rover.requests(512, 33)
    assert rover.last("GLOBAL_POSITION_INT").relative_alt / 1000 == pytest.approx(0.0, abs=0.1)


def test_it_stops_by_itself_three_seconds_after_the_last_setpoint(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    metres, seconds = stopped_after(rover)
    assert "target not received last 3secs, stopping" in rover.texts
    assert metres == pytest.approx(13.2, abs=1.0)
    assert seconds == pytest.approx(8.0, abs=1.5)


@pytest.mark.parametrize(
    ("mode", "metres", "seconds"), [(HOLD, 6.9, 6.8), (LOITER, 5.4, 2.8)], ids=["hold", "loiter"]
)
def test_it_brakes_by_a_mode_as_the_recorded_one(rover, mode, metres, seconds):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.body.speed == pytest.approx(3.45, abs=0.1)
    assert rover.requests(176, 1, mode) == [ACCEPTED]
    went, took = stopped_after(rover)
    assert went == pytest.approx(metres, abs=0.8)
    assert took == pytest.approx(seconds, abs=0.8)


def test_guided_again_is_no_stop(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.requests(176, 1, GUIDED) == [ACCEPTED]
    rover.run(2.0)
    assert rover.body.speed > 3.0


def test_a_speed_of_zero_is_refused_and_it_drives_on(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.requests(178, 1, 0, -1) == [FAILED]
    rover.run(1.0)
    assert rover.body.speed > 3.0


def test_a_disarmed_one_coasts(rover):
    rover.stream(4.0, 2.0, mask=AHEAD)
    assert rover.requests(400, 0) == [ACCEPTED]
    metres, _ = stopped_after(rover)
    assert metres == pytest.approx(3.8, abs=0.8)


def test_it_drives_to_a_place_and_home_and_stays_armed(rover):
    place = (47.397742 + 20 / 111_195, 8.545594, 0.0)
    assert rover.requests_int(mav.MAV_CMD_DO_REPOSITION, 6, (-1, 1, 0, math.nan), *place) == [ACCEPTED]
    rover.until(lambda: rover.body.north > 19.0)
    assert rover.requests(20) == [ACCEPTED]
    rover.until(lambda: "Reached destination" in rover.texts)
    assert rover.pilot.armed
    assert rover.mode == "RTL"


def behind(metres):
    return (47.397742 - metres / 111_195, 8.545594, 0.0)


def test_it_drives_to_a_place_in_reverse_until_its_mode_changes(rover):
    assert rover.requests(194, 1) == [ACCEPTED]
    assert rover.requests_int(mav.MAV_CMD_DO_REPOSITION, 6, (-1, 1, 0, math.nan), *behind(8)) == [ACCEPTED]
    assert rover.requests(178, 1, 1.0, -1) == [ACCEPTED]
    rover.run(16.0)
    assert rover.body.north == pytest.approx(-8.0, abs=0.7)
    assert abs(math.remainder(rover.body.heading, math.tau)) < 0.1
    rover.requests(176, 1, HOLD)
    rover.requests(176, 1, GUIDED)
    assert rover.requests_int(mav.MAV_CMD_DO_REPOSITION, 6, (-1, 1, 0, math.nan), *behind(0)) == [ACCEPTED]
    rover.run(3.0)
    assert rover.body.along > 0.5


def test_a_speed_is_refused_while_it_has_no_place_to_drive_to(rover):
    assert rover.requests(178, 1, 2.0, -1) == [FAILED]


def test_a_station_that_falls_silent_makes_it_act_after_its_time(rover):
    rover.set_param("FS_GCS_ENABLE", 1)
    rover.set_param("FS_ACTION", 1)
    rover.stream(2.0, 2.0, mask=KEEP)
    rover.gcs = False
    rover.until(lambda: "GCS Failsafe" in rover.texts, limit=5.0)
    assert rover.mode == "RTL"


def test_a_lost_position_makes_it_hold(rover):
    rover.stream(2.0, 2.0, mask=KEEP)
    rover.set_param("SIM_GPS_DISABLE", 1)
    rover.until(lambda: "EKF failsafe" in rover.texts, limit=20.0)
    assert rover.mode == "HOLD"


def test_a_flavour_has_the_vehicles_that_it_has(bench):
    with pytest.raises(KeyError):
        bench("px4", vehicle="rover")
