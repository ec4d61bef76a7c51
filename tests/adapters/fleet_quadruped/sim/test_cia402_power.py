"""The state machine of a simulated drive, as CiA 402-2 has it, and its torque in each state."""

import pytest

from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.sim.cia402_power import PowerStage
from fleet_quadruped.sim.sdo import DictionaryEntry
from fleet_quadruped.sim.world import SimMotor

DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT = (
    DriveState.SWITCH_ON_DISABLED,
    DriveState.READY,
    DriveState.SWITCHED_ON,
    DriveState.ENABLED,
    DriveState.QUICK_STOP,
    DriveState.FAULT,
)
ON_THE_WAY = {DISABLED: (), READY: (0x06,), SWITCHED_ON: (0x06, 0x07), ENABLED: (0x06, 0x07, 0x0F)}
RESET = 0x80
DT = 0.002


class Bench:
    """A power stage in a state; ``options``: stop options (605Ah, 605Ch, 605Eh, 6007h)."""

    def __init__(self, state=ENABLED, *, speed=0.0, quick=6, disable=1, fault=2, lost=3):
        options = {0x605A: quick, 0x605C: disable, 0x605E: fault, 0x6007: lost}
        self.motor = SimMotor(speed=speed)
        self.stage = PowerStage(
            self.motor, {(place, 0): DictionaryEntry(2, value) for place, value in options.items()}
        )
        self.tell(*ON_THE_WAY[state])
        assert self.stage.state is state

    def tell(self, *words):
        for word in words:
            self.stage.handle_control_word(word)
        return self

    def go(self, seconds=0.3):
        for _ in range(round(seconds / DT)):
            self.stage.slow_down(DT)
        return self.stage.state

    @property
    def has_torque(self):
        """Return whether the motor gets torque in the next moment of a stop."""
        self.motor.kp = 0.0
        self.stage.slow_down(DT)
        return self.motor.kp > 0


TRANSITIONS = {
    (DISABLED, 0x06): READY,
    (READY, 0x00): DISABLED,
    (READY, 0x02): DISABLED,
    (READY, 0x07): SWITCHED_ON,
    (SWITCHED_ON, 0x00): DISABLED,
    (SWITCHED_ON, 0x02): DISABLED,
    (SWITCHED_ON, 0x06): READY,
    (SWITCHED_ON, 0x0F): ENABLED,
    (ENABLED, 0x00): DISABLED,
    (ENABLED, 0x02): QUICK_STOP,
    (ENABLED, 0x06): READY,
    (ENABLED, 0x07): SWITCHED_ON,
}
"""Shutdown 06h, switch on 07h, enable operation 0Fh, quick stop 02h, disable voltage 00h."""


@pytest.mark.parametrize("word", [0x00, 0x02, 0x06, 0x07, 0x0F])
@pytest.mark.parametrize("state", ON_THE_WAY)
def test_a_command_leads_from_a_state_where_the_standard_says(state, word):
    bench = Bench(state, speed=1.0).tell(word)
    assert bench.go() is TRANSITIONS.get((state, word), state)


@pytest.mark.parametrize("word", [0x01, 0x04, 0x05, 0x0D])
def test_any_word_without_its_second_bit_takes_the_voltage_off(word):
    bench = Bench(speed=1.0).tell(word)
    assert (bench.stage.state, bench.has_torque) == (DISABLED, False)


@pytest.mark.parametrize("word", [0x16, 0x106, 0x36])
def test_bits_of_the_mode_are_no_command(word):
    assert Bench(DISABLED).tell(word).stage.state is READY


def test_a_fault_is_left_by_a_rising_edge_of_the_reset_bit_alone():
    bench = Bench(speed=1.0)
    bench.stage.fail()
    assert bench.stage.state is DriveState.FAULT_REACTION
    assert bench.tell(RESET).stage.state is DriveState.FAULT_REACTION
    assert bench.go() is FAULT
    for word in (RESET, 0x00, 0x06, 0x07, 0x0F):  # the bit was set before it was in fault
        assert bench.tell(word).stage.state is FAULT
    assert bench.tell(RESET).stage.state is DISABLED
    assert bench.tell(RESET | 0x06).stage.state is READY


def test_a_fault_brakes_with_torque_and_ends_without():
    bench = Bench(speed=1.0)
    bench.stage.fail()
    assert bench.has_torque
    bench.go()
    assert bench.motor.kp == 0
    assert not bench.has_torque


def test_a_quick_stop_without_a_ramp_lets_go_at_once():
    assert Bench(speed=1.0, quick=0).tell(0x02).stage.state is DISABLED


def test_a_word_that_is_repeated_does_not_begin_its_stop_anew():
    bench = Bench(speed=1.0)
    for _ in range(60):
        bench.tell(0x07).go(DT)
    assert bench.stage.state is SWITCHED_ON


@pytest.mark.parametrize("state", [DISABLED, READY, SWITCHED_ON])
def test_a_drive_without_torque_gets_none_from_a_fault(state):
    bench = Bench(state, speed=1.0)  # a leg that swings
    bench.stage.fail()
    assert (bench.stage.state, bench.has_torque) == (FAULT, False)


def test_a_second_fault_changes_nothing():
    bench = Bench(speed=1.0)
    bench.stage.fail()
    bench.go()
    bench.stage.fail()
    assert (bench.stage.state, bench.has_torque) == (FAULT, False)


def test_taking_the_voltage_off_ends_a_stop_that_holds():
    bench = Bench(speed=1.0).tell(0x02)
    assert (bench.go(), bench.has_torque) == (QUICK_STOP, True)
    bench.tell(0x00)
    assert (bench.stage.state, bench.has_torque) == (DISABLED, False)


def test_a_stop_that_holds_is_left_for_operation_and_one_that_does_not_hold_is_not():
    assert Bench(speed=1.0).tell(0x02, 0x0F).stage.state is ENABLED
    assert Bench(speed=1.0, quick=2).tell(0x02, 0x0F).stage.state is QUICK_STOP
    stubborn = Bench(speed=1.0)
    stubborn.stage.stay()
    assert stubborn.tell(0x02, 0x0F).stage.state is QUICK_STOP
    assert stubborn.tell(0x00).stage.state is DISABLED


def test_a_lazy_drive_ignores_its_first_commands_to_enable_it():
    bench = Bench(SWITCHED_ON)
    bench.stage.dozing = 2
    assert [bench.stage.handle_control_word(0x0F) for _ in range(3)] == [False, False, True]
    assert bench.stage.state is ENABLED
    other = Bench(SWITCHED_ON)
    other.stage.dozing = 2
    assert other.tell(0x06).stage.state is READY


def test_a_repeated_word_is_taken_and_changes_nothing():
    bench = Bench()
    assert bench.stage.handle_control_word(0x0F)
    assert (bench.stage.state, bench.stage.slow_down(DT)) == (ENABLED, False)


@pytest.mark.parametrize(
    ("option", "state"), [(0, ENABLED), (1, FAULT), (2, DISABLED), (3, QUICK_STOP), (9, ENABLED)]
)
def test_the_loss_of_its_master_stops_an_enabled_drive_as_6007h_says(option, state):
    bench = Bench(speed=1.0, lost=option)
    bench.stage.lose_connection()
    assert bench.go() is state


@pytest.mark.parametrize("option", [1, 2, 3])
def test_the_loss_of_its_master_leaves_other_drives_as_they_are(option):
    bench = Bench(SWITCHED_ON, lost=option)
    bench.stage.lose_connection()
    assert bench.stage.state is SWITCHED_ON


def test_power_on_is_without_torque():
    bench = Bench(speed=1.0).tell(0x02)
    bench.stage.boot()
    assert (bench.stage.state, bench.has_torque) == (DISABLED, False)
