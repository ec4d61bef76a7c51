import pytest

from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.cia402.states import POWER, Goal, State, control_words, state_of


@pytest.mark.parametrize(
    ("status", "state"),
    [
        (0x0000, State.NOT_READY),
        (0x0250, State.SWITCH_ON_DISABLED),
        (0x0231, State.READY),
        (0x0233, State.SWITCHED_ON),
        (0x1237, State.ENABLED),
        (0x0217, State.QUICK_STOP),
        (0x021F, State.FAULT_REACTION),
        (0x0218, State.FAULT),
        (0x1637, State.ENABLED),
        (0x0288, State.FAULT),
    ],
)
def test_a_status_word_is_one_state(status, state):
    assert state_of(status) is state


def test_the_walk_to_enabled_takes_three_steps():
    walk = [State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED]
    assert control_words(Goal.ENABLE, walk) == [0x06, 0x07, 0x0F, 0x0F]


def test_a_quick_stop_that_holds_is_left_only_to_lower_the_dog():
    both = [State.ENABLED, State.QUICK_STOP]
    assert control_words(Goal.HOLD, both) == [0x0F, 0x02]
    assert control_words(Goal.LOWER, both) == [0x0F, 0x0F]
    assert control_words(Goal.STOP, both) == [0x02, 0x02]


@pytest.mark.parametrize("goal", [Goal.OFF, Goal.ENABLE, Goal.HOLD, Goal.LOWER, Goal.STOP])
@pytest.mark.parametrize("state", State)
def test_a_fault_is_never_acknowledged_without_being_asked(goal, state):
    assert not control_words(goal, [state])[0] & 0x80


def test_a_quick_stop_is_not_left_towards_enabled():
    assert control_words(Goal.ENABLE, [State.QUICK_STOP]) == [0x00]


@pytest.mark.parametrize("state", State)
def test_off_takes_the_voltage_away(state):
    assert control_words(Goal.OFF, [state]) == [0x00]


def test_every_state_means_something_for_the_dog():
    assert set(POWER) == set(State)
    assert [state for state in State if POWER[state] is Power.ENABLED] == [State.ENABLED]
