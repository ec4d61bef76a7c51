"""Which commands are motion that a halt ends, for each kind of vehicle that is moved here."""

import pytest

from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.ardupilot_plane import ArduPlane, QuadPlane
from fleet_mavlink.ardupilot_rover import ArduBoat, ArduRover
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.flavour import arm_command
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.motion_effect import Effect, effect_of, effect_of_descent
from fleet_mavlink.px4 import Px4


@pytest.mark.parametrize(
    "flavour", [ArduCopter(), ArduPlane(), QuadPlane(), Px4()], ids=lambda each: type(each).__name__
)
def test_what_flies_comes_down_by_its_landing_and_its_way_home(flavour):
    assert effect_of_descent(flavour) is Effect.COMING_DOWN


@pytest.mark.parametrize("flavour", [ArduRover(), ArduBoat()], ids=lambda each: type(each).__name__)
def test_the_way_home_of_what_drives_is_motion_for_it_is_safer_where_it_stands(flavour):
    assert effect_of_descent(flavour) is Effect.MOTION


def test_a_start_is_motion_and_the_end_of_one_or_a_picture_is_not():
    assert effect_of(arm_command(arm=True, force=False)) is Effect.MOTION
    assert effect_of(CommandLong(MavCmd.NAV_TAKEOFF)) is Effect.MOTION
    assert effect_of(CommandLong(MavCmd.DO_VTOL_TRANSITION)) is Effect.MOTION
    assert effect_of(arm_command(arm=False, force=True)) is Effect.NONE
    assert effect_of(CommandLong(MavCmd.RUN_PREARM_CHECKS)) is Effect.NONE
