"""What every kind of vehicle has: names of its modes, and ways to brake it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.flavours import kind_of
from fleet_mavlink.messages import CommandLong, Heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle_kind import Brake, VehicleKind

HOLD, LOITER, STOP = CommandLong(1), CommandLong(2), CommandLong(3)
KINDS = sorted(
    {kind_of(Heartbeat(kind, autopilot)) for kind in range(46) for autopilot in (3, 12, 8)},
    key=lambda kind: type(kind).__name__,
)
each_kind = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: type(kind).__name__)


class Sled(VehicleKind):
    """A vehicle with three modes, and two brakes of which one needs another before it."""

    modes = {0: "MANUAL", 4: "HOLD", 10: "AUTO"}

    def brakes(self, state):
        return Brake("AUTO", LOITER, first=Brake("HOLD", HOLD)), Brake("MANUAL", STOP)

    def position_usable(self, state, now):
        return None

    def ready_to_arm(self, state):
        return None


SLED = Sled()


def test_a_mode_has_its_name_and_an_unknown_one_its_number():
    assert (SLED.mode_name(4), SLED.mode_name(0)) == ("HOLD", "MANUAL")
    assert SLED.mode_name(0x03040000) == "MODE(0x3040000)"


@given(st.integers(0, 2**32 - 1))
def test_every_number_on_the_wire_has_a_name_for_a_mode(number):
    assert all(kind.mode_name(number) for kind in KINDS)


def test_the_present_mode_is_that_of_the_newest_heartbeat():
    assert SLED.mode_of(VehicleState()) == ""
    assert SLED.mode_of(VehicleState(heartbeat=Heartbeat(10, 3, custom_mode=10))) == "AUTO"


@each_kind
def test_the_number_of_a_mode_leads_back_to_its_name(kind):
    for name in kind.modes.values():
        assert kind.mode_name(kind.number_of(name)) == name


def test_a_brake_that_needs_another_is_sent_and_shown_after_it():
    chained = Brake("LAST", STOP, first=Brake("SECOND", LOITER, first=Brake("FIRST", HOLD)))
    assert chained.requests == (HOLD, LOITER, STOP)
    assert chained.modes == ("FIRST", "SECOND", "LAST")
    assert (Brake("HOLD", HOLD).requests, Brake("HOLD", HOLD).modes) == ((HOLD,), ("HOLD",))


def test_during_braking_the_modes_of_every_brake_may_be_shown_in_the_order_of_their_trial():
    assert SLED.brake_modes(VehicleState()) == ("HOLD", "AUTO", "MANUAL")


@each_kind
def test_every_vehicle_has_a_brake_and_leads_to_modes_that_it_has(kind):
    brakes = kind.brakes(VehicleState())
    assert brakes
    shown = set(kind.brake_modes(VehicleState())) - {""}  # empty: it shows none
    assert shown <= set(kind.modes.values())
    assert all(brake.requests for brake in brakes)


def test_a_stopped_vehicle_is_slowing_down_below_seven_tenths_of_its_speed():
    assert SLED.slows_to(10.0) == pytest.approx(7.0)
    assert SLED.slows_to(0.0) == 0.0


def test_a_vehicle_of_which_nothing_else_is_said_stands_when_it_braked_and_is_not_moved_here():
    assert SLED.stands(VehicleState())
    assert (SLED.flavour, SLED.may_be_disarmed, SLED.goes_over) == (None, False, False)
