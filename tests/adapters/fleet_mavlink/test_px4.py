"""PX4 of multirotors: heights above the sea, goals by DO_REPOSITION, and its texts about a calibration."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import GeoPoint, Refused
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.flavour import CalibrationStep
from fleet_mavlink.messages import CommandInt, CommandLong, Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence

PX4 = Px4()


def step(text):
    return PX4.calibration_step(Sentence(text, 6, 0.0))


@given(st.floats(1, 500), st.floats(-400, 4000))
def test_a_take_off_climbs_above_the_sea_and_at_the_place_where_it_stands(altitude, home):
    command = PX4.takeoff_command(altitude, home)
    assert (command.command, command.param7) == (MavCmd.NAV_TAKEOFF, altitude + home)
    assert all(math.isnan(each) for each in (command.param4, command.param5, command.param6))
    assert command.param1 == 0.0  # no pitch is asked for


@given(
    st.floats(-90, 90), st.floats(-180, 180), st.floats(-400, 9000), st.floats(0.2, 30), st.floats(-3.1, 3.1)
)
def test_a_goal_has_its_place_to_a_centimetre_its_speed_and_its_heading_in_radians(
    latitude, longitude, altitude, speed, heading
):
    command = PX4.go_command(GeoPoint(latitude, longitude, altitude), 488.0, speed, heading)
    assert isinstance(command, CommandInt)
    assert command.x / 1e7 == pytest.approx(latitude, abs=1e-7)
    assert command.y / 1e7 == pytest.approx(longitude, abs=1e-7)
    assert (command.frame, command.z) == (5, altitude)
    assert (command.param1, command.param2, command.param4) == (speed, 1.0, heading)


def test_no_second_command_sets_the_speed():
    assert PX4.command_after_go(3.0, VehicleState()) is None
    assert PX4.command_before_go(backwards=False) is None


def test_it_lands_by_its_mode_and_is_seen_to_come_down_in_it_and_on_its_way_home():
    assert PX4.land_command() == PX4.mode_command("AUTO.LAND")
    for mode, comes in ((0x06040000, True), (0x05040000, True), (0x03040000, False), (0x04040000, False)):
        assert PX4.comes_down(VehicleState(heartbeat=Heartbeat(2, 12, 0x80, mode))) is comes


def test_a_take_off_ends_in_the_hold_by_itself_and_no_other_mode_changes():
    assert PX4.follows == {"AUTO.TAKEOFF": {"AUTO.LOITER"}}


def test_a_calibration_is_of_the_compass_alone_and_stopped_by_calibrating_nothing():
    assert PX4.compass_start == CommandLong(241, param2=1.0)
    assert PX4.compass_stop == CommandLong(241)


@pytest.mark.parametrize(
    ("text", "percent"),
    [
        ("[cal] progress <0>", 0.0),
        ("[cal] progress <42>", 42.0),
        ("[cal] progress <100>", 99.0),  # only "done" is the end
        ("[cal] calibration done: mag", 100.0),
    ],
)
def test_its_texts_are_its_progress(text, percent):
    assert step(text) == CalibrationStep(percent)


@pytest.mark.parametrize(
    "text",
    [
        "progress <42>",
        "[cal] progress <42> of it",
        "[cal] progress <1234>",
        "[cal] progress <-1>",
        "[cal] calibration started: 2 mag",
        "[cal] up side done, rotate to a different side",
        "calibration done: mag",
    ],
)
def test_other_texts_are_no_progress(text):
    assert step(text) is None


def test_messages_that_are_no_texts_are_no_progress():
    assert PX4.calibration_step(Heartbeat(2, 12)) is None


@pytest.mark.parametrize("words", ["calibration failed: timeout: no motion", "calibration cancelled"])
def test_a_failure_is_told_in_its_own_words(words):
    with pytest.raises(Refused) as failed:
        step(f"[cal] {words}")
    assert failed.value.reason == words
