"""ArduRover 4.6.3 as it was recorded: ap_rover and ap_rover_stops."""

import pytest

ACCEPTED = 0
MANUAL, GUIDED = 0, 15


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


def test_its_landed_state_is_never_reported_and_its_height_is_that_of_the_sea(rover):
    rover.requests(512, 245)
    assert rover.last("EXTENDED_SYS_STATE").landed_state == 0
    rover.requests(512, 33)
    assert rover.last("GLOBAL_POSITION_INT").relative_alt / 1000 == pytest.approx(487.9, abs=0.2)
    assert rover.requests(400, 0) == [ACCEPTED]
    rover.requests(512, 33)
    assert rover.last("GLOBAL_POSITION_INT").relative_alt / 1000 == pytest.approx(0.0, abs=0.1)


def test_a_flavour_has_the_vehicles_that_it_has(bench):
    with pytest.raises(KeyError):
        bench("px4", vehicle="rover")
