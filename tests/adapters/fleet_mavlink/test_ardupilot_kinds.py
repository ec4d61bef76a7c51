"""Kinds of ArduPilot vehicles: the numbers of their modes, how each brakes, and when each can be armed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_kinds import ArduBlimp, ArduSub, ArduTracker
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.state import VehicleState

COPTER, SUB, TRACKER, BLIMP = ArduCopter(), ArduSub(), ArduTracker(), ArduBlimp()
POSITION = 0x10  # EKF_POS_HORIZ_ABS
KINDS = pytest.mark.parametrize("kind", [COPTER, SUB, TRACKER, BLIMP], ids=lambda kind: type(kind).__name__)


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [
        (SUB, {"STABILIZE": 0, "ALT_HOLD": 2, "GUIDED": 4, "SURFACE": 9, "POSHOLD": 16, "MANUAL": 19}),
        (SUB, {"MOTOR_DETECT": 20}),
        (TRACKER, {"MANUAL": 0, "STOP": 1, "SCAN": 2, "GUIDED": 4, "AUTO": 10, "INITIALISING": 16}),
        (BLIMP, {"LAND": 0, "MANUAL": 1, "VELOCITY": 2, "LOITER": 3, "RTL": 4}),
        (COPTER, {"STABILIZE": 0, "GUIDED": 4, "RTL": 6, "LAND": 9, "BRAKE": 17}),
    ],
    ids=lambda value: type(value).__name__,
)
def test_modes_have_the_numbers_of_the_firmware(kind, numbers):
    assert {name: kind.number_of(name) for name in numbers} == numbers


@pytest.mark.parametrize(
    ("kind", "modes"),
    [
        (SUB, ["POSHOLD", "ALT_HOLD"]),  # ALT_HOLD needs no position
        (TRACKER, ["STOP"]),
        (BLIMP, ["LOITER", "LAND"]),
    ],
)
def test_a_vehicle_that_is_only_stopped_brakes_in_the_mode_that_holds_best_and_then_in_one_that_needs_less(
    kind, modes
):
    brakes = kind.brakes(VehicleState())
    assert [brake.mode for brake in brakes] == modes
    assert [brake.request for brake in brakes] == [kind.mode_command(mode) for mode in modes]


@KINDS
def test_every_mode_is_set_by_its_custom_number(kind):
    for number, mode in kind.modes.items():
        expected = CommandLong(MavCmd.DO_SET_MODE, param1=1.0, param2=float(number))
        assert kind.mode_command(mode) == expected


def test_motors_are_switched_off_only_where_nothing_falls():
    assert (SUB.may_be_disarmed, TRACKER.may_be_disarmed) == (True, True)
    assert (BLIMP.may_be_disarmed, COPTER.may_be_disarmed) == (False, False)


@KINDS
@given(flags=st.none() | st.integers(0, 0xFFFF), prearm=st.sampled_from([None, False, True]))
def test_it_can_be_armed_once_the_check_passes_with_a_position_and_unknown_is_neither_yes_nor_no(
    kind, flags, prearm
):
    state = VehicleState(estimator_flags=flags, prearm_ok=prearm)
    if flags is None or prearm is None:
        assert kind.ready_to_arm(state) is None
    else:
        assert kind.ready_to_arm(state) is (prearm and bool(flags & POSITION))


@pytest.mark.parametrize(
    ("flags", "usable"), [(None, None), (0, False), (POSITION, True), (0x33F & ~POSITION, False)]
)
def test_a_position_is_usable_when_the_estimator_says_so_however_old_it_is(flags, usable):
    state = VehicleState(estimator_flags=flags, position_at=-1e9)
    assert COPTER.position_usable(state, 1e9) is usable
