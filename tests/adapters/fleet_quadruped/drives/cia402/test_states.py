import pytest
from canopen.profiles.p402 import State402

from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.cia402 import states
from fleet_quadruped.drives.cia402.states import POWER, DriveGoal, DriveState, control_words, state_of


@pytest.mark.parametrize(
    ("status", "state"),
    [
        (0x0000, DriveState.NOT_READY),
        (0x0250, DriveState.SWITCH_ON_DISABLED),
        (0x0231, DriveState.READY),
        (0x0233, DriveState.SWITCHED_ON),
        (0x1237, DriveState.ENABLED),
        (0x0217, DriveState.QUICK_STOP),
        (0x021F, DriveState.FAULT_REACTION),
        (0x0218, DriveState.FAULT),
        (0x1637, DriveState.ENABLED),
        (0x0288, DriveState.FAULT),
    ],
)
def test_a_status_word_is_one_state(status, state):
    assert state_of(status) is state


@pytest.mark.parametrize("status", range(0x70))
def test_each_status_word_is_the_state_that_the_canopen_library_takes_it_for(status):
    known = [name.lower() for name, (mask, value) in State402.SW_MASK.items() if status & mask == value]
    assert [str(state_of(status))] == (known or [str(DriveState.NOT_READY)])


def test_the_control_words_are_those_of_the_canopen_library():
    assert states.DISABLE_VOLTAGE == State402.CW_DISABLE_VOLTAGE
    assert states.QUICK_STOP == State402.CW_QUICK_STOP
    assert states.SHUTDOWN == State402.CW_SHUTDOWN
    assert states.SWITCH_ON == State402.CW_SWITCH_ON
    assert states.ENABLE == State402.CW_OPERATION_ENABLED
    assert states.RESET == State402.CW_SWITCH_ON_DISABLED


def test_the_walk_to_enabled_takes_three_steps():
    walk = [DriveState.SWITCH_ON_DISABLED, DriveState.READY, DriveState.SWITCHED_ON, DriveState.ENABLED]
    assert control_words(DriveGoal.ENABLE, walk) == [0x06, 0x07, 0x0F, 0x0F]


def test_a_quick_stop_that_holds_is_left_only_to_lower_the_dog():
    both = [DriveState.ENABLED, DriveState.QUICK_STOP]
    assert control_words(DriveGoal.HOLD, both) == [0x0F, 0x02]
    assert control_words(DriveGoal.LOWER, both) == [0x0F, 0x0F]
    assert control_words(DriveGoal.STOP, both) == [0x02, 0x02]


@pytest.mark.parametrize(
    "goal", [DriveGoal.OFF, DriveGoal.ENABLE, DriveGoal.HOLD, DriveGoal.LOWER, DriveGoal.STOP]
)
@pytest.mark.parametrize("state", DriveState)
def test_a_fault_is_never_acknowledged_without_being_asked(goal, state):
    assert not control_words(goal, [state])[0] & 0x80


def test_a_quick_stop_is_not_left_towards_enabled():
    assert control_words(DriveGoal.ENABLE, [DriveState.QUICK_STOP]) == [0x00]


@pytest.mark.parametrize("state", DriveState)
def test_off_takes_the_voltage_away(state):
    assert control_words(DriveGoal.OFF, [state]) == [0x00]


def test_every_state_means_something_for_the_dog():
    assert set(POWER) == set(DriveState)
    assert [state for state in DriveState if POWER[state] is Power.ENABLED] == [DriveState.ENABLED]
