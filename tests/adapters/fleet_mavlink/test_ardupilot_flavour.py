"""What all moved ArduPilot vehicles share: speed after a goal, and the calibration of their compasses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import Refused
from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_plane import ArduPlane, QuadPlane
from fleet_mavlink.ardupilot_rover import ArduRover
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.flavour import CalibrationStep
from fleet_mavlink.messages import CommandLong, Heartbeat
from fleet_mavlink.payload_messages import MagCalProgress, MagCalReport
from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import Sentence

COPTER, ROVER = ArduCopter(), ArduRover()
moved = pytest.mark.parametrize("flavour", [COPTER, ROVER], ids=["copter", "rover"])


def report(compass, mask, status, fitness=5.0):
    return MagCalReport(compass, mask, status, 1, fitness)


@moved
def test_it_holds_by_its_holding_mode_whatever_it_does(flavour):
    for state in (VehicleState(), VehicleState(heartbeat=Heartbeat(2, 3, 0x80, 4))):
        command = flavour.hold_command(state)
        assert (command.command, command.param2) == (MavCmd.DO_SET_MODE, flavour.number_of(flavour.hold))


@moved
def test_setpoints_and_positions_take_the_same_mode_so_that_a_stop_need_not_know_which_was_sent(flavour):
    assert flavour.external == flavour.goto == flavour.arming == flavour.takeoff == "GUIDED"
    assert flavour.ours == {"GUIDED", flavour.hold}


@pytest.mark.parametrize("speed", [0.2, 3.0, 25.0])
def test_the_speed_of_a_goal_is_sent_over_ground_in_metres_a_second_with_the_throttle_left_alone(speed):
    assert COPTER.command_after_go(speed, VehicleState()) == CommandLong(
        178, param1=1.0, param2=speed, param3=-1.0
    )


def test_a_mission_begins_at_its_first_item_again():
    assert COPTER.rewind == CommandLong(MavCmd.DO_SET_MISSION_CURRENT, param1=0.0)
    assert COPTER.home_is_first


def test_a_calibration_is_started_for_all_compasses_and_saved_by_the_autopilot():
    start = COPTER.compass_start
    assert (start.command, start.param1, start.param3) == (MavCmd.DO_START_MAG_CAL, 0.0, 1.0)
    assert COPTER.compass_stop.command == MavCmd.DO_CANCEL_MAG_CAL


@given(st.integers(0, 7), st.integers(0, 255), st.integers(0, 255))
def test_progress_is_that_of_one_compass_and_is_done_only_by_its_report(compass, mask, percent):
    step = COPTER.calibration_step(MagCalProgress(compass, mask, percent))
    assert step.compass == compass
    assert step.percent == min(percent, 99)
    assert sum(1 << each for each in step.others) == mask | 1 << compass


def test_a_successful_report_is_the_end_for_its_compass_alone():
    assert COPTER.calibration_step(report(1, 0b101, 4)) == CalibrationStep(100.0, 1, frozenset({0, 1, 2}))


@pytest.mark.parametrize("status", [0, 1, 2, 3, 5, 6, 7])
def test_any_other_report_is_a_failure_with_its_numbers_and_a_remedy(status):
    with pytest.raises(Refused, match="calibration failed") as failed:
        COPTER.calibration_step(report(2, 4, status, fitness=87.654))
    assert f"compass 2: status {status}, fitness 87.7" in failed.value.reason
    assert failed.value.hint == "away from metal, all axes"


def test_nothing_else_is_about_a_calibration():
    for said in (Heartbeat(2, 3), Sentence("[cal] calibration done: mag", 6, 0.0)):
        assert COPTER.calibration_step(said) is None


@pytest.mark.parametrize("flavour", [ArduPlane(), QuadPlane(), COPTER, ROVER])
def test_the_modes_that_it_is_moved_and_brought_home_in_are_modes_that_it_has(flavour):
    used = {flavour.external, flavour.goto, flavour.mission, flavour.return_home, flavour.hold}
    assert used <= set(flavour.modes.values())
