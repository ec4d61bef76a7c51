"""Which commands are motion that a halt ends, for each kind of vehicle that is moved here."""

import pytest

from fleet import GeoPoint
from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_rover import ArduBoat, ArduRover
from fleet_mavlink.constants import Cmd
from fleet_mavlink.flavour import arm_command
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.motion_effect import Effect, effect_of, effect_of_change
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState

EVERY = (ArduCopter(), ArduRover(), ArduBoat(), Px4())


def change(flavour, mode):
    return effect_of_change(mode, flavour.mode_command(mode), flavour, VehicleState())


@pytest.mark.parametrize("flavour", EVERY, ids=lambda each: type(each).__name__)
def test_the_modes_that_move_it_are_motion_and_its_hold_and_brakes_are_not(flavour):
    for mode in (flavour.external, flavour.mission):
        assert change(flavour, mode) is Effect.MOTION
    for mode in (flavour.hold, *(brake.mode for brake in flavour.brakes(VehicleState()))):
        assert change(flavour, mode) is Effect.NONE
    assert effect_of_change(flavour.hold, flavour.hold_command(), flavour, VehicleState()) is Effect.NONE


@pytest.mark.parametrize("flavour", [ArduRover(), Px4()], ids=lambda each: type(each).__name__)
def test_a_place_is_motion_though_the_mode_may_be_that_of_the_hold(flavour):
    go = flavour.go_command(GeoPoint(47.0, 8.0, 500.0), 490.0, 2.0, 0.0)
    assert effect_of_change(flavour.goto, go, flavour, VehicleState()) is Effect.MOTION


@pytest.mark.parametrize("flavour", [ArduCopter(), Px4()], ids=lambda each: type(each).__name__)
def test_what_flies_comes_down_by_its_landing_and_its_way_home(flavour):
    assert {change(flavour, mode) for mode in (flavour.land, flavour.return_home)} == {Effect.COMING_DOWN}


def test_the_way_home_of_a_rover_is_motion_for_it_is_safer_where_it_stands():
    assert change(ArduRover(), "RTL") is Effect.MOTION


def test_a_start_is_motion_and_the_end_of_one_or_a_picture_is_not():
    assert effect_of(arm_command(arm=True, force=False)) is Effect.MOTION
    assert effect_of(CommandLong(Cmd.NAV_TAKEOFF)) is Effect.MOTION
    assert effect_of(arm_command(arm=False, force=True)) is Effect.NONE
    assert effect_of(CommandLong(Cmd.RUN_PREARM_CHECKS)) is Effect.NONE


def test_a_vehicle_that_is_not_moved_here_is_only_braked():
    assert effect_of_change("HOLD", CommandLong(Cmd.DO_SET_MODE), None, VehicleState()) is Effect.NONE
