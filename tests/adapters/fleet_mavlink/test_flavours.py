"""The differences between autopilots, one by one."""

import math

import pytest

from fleet import GeoPoint
from fleet_mavlink.ardupilot import ArduCopter
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.flavours import flavour_of
from fleet_mavlink.messages import CommandInt, CommandLong, Heartbeat, SetPositionTargetGlobalInt
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState

ARDUPILOT, PX4 = ArduCopter(), Px4()
PLACE = GeoPoint(47.3977421, -8.5455941, 503.0)
flavours = pytest.mark.parametrize("flavour", [ARDUPILOT, PX4])


@pytest.mark.parametrize(
    ("kind", "autopilot", "name"),
    [
        (2, 3, "ArduCopter"),
        (13, 3, "ArduCopter"),
        (2, 12, "Px4"),
        (10, 3, "ArduRover"),
        (11, 3, "ArduBoat"),
        (1, 3, "UnknownArduPlane"),
        (20, 3, "UnknownArduPlane"),
        (1, 12, "Px4Plane"),
        (22, 12, "Px4VtolForward"),
        *((kind, 12, None) for kind in (7, 10, 11, 12)),
        *((kind, 3, None) for kind in (7, 12)),
        (2, 4, None),
    ],
)
def test_aircraft_and_ardupilots_rovers_are_moved_and_nothing_else(kind, autopilot, name):
    flavour = flavour_of(Heartbeat(kind, autopilot))
    assert (type(flavour).__name__ if flavour else None) == name


@flavours
def test_every_mode_that_is_used_has_a_number(flavour):
    used = flavour.ours | {flavour.land, flavour.return_home} | set(flavour.follows)
    assert {flavour.mode_name(flavour.number_of(mode)) for mode in used} == used


@flavours
def test_a_mode_without_a_name_is_reported_by_its_number(flavour):
    assert flavour.mode_name(0x77777777) == "MODE(0x77777777)"


def test_modes_are_set_as_each_autopilot_wants_it():
    assert ARDUPILOT.mode_command("BRAKE") == CommandLong(MavCmd.DO_SET_MODE, param1=1.0, param2=17.0)
    assert PX4.mode_command("AUTO.LAND") == CommandLong(
        MavCmd.DO_SET_MODE, param1=1.0, param2=4.0, param3=6.0
    )
    assert PX4.mode_command("OFFBOARD") == CommandLong(MavCmd.DO_SET_MODE, param1=1.0, param2=6.0, param3=0.0)


def test_ardupilot_never_holds_in_a_mode_that_needs_a_stick():
    assert ARDUPILOT.hold not in {"LOITER", "ALT_HOLD", "POSHOLD", "STABILIZE"}


def test_takeoff_is_above_home_for_ardupilot_and_above_the_sea_for_px4():
    assert ARDUPILOT.takeoff_command(10.0, 488.0).param7 == 10.0
    command = PX4.takeoff_command(10.0, 488.0)
    assert command.param7 == 498.0
    assert math.isnan(command.param5)
    assert math.isnan(command.param6)


def test_a_place_is_above_home_for_ardupilot_and_above_the_sea_for_px4():
    ours, theirs = ARDUPILOT.go_command(PLACE, 488.0, 3.0, 1.0), PX4.go_command(PLACE, 488.0, 3.0, 1.0)
    assert isinstance(ours, SetPositionTargetGlobalInt)
    assert isinstance(theirs, CommandInt)
    assert (ours.coordinate_frame, ours.alt) == (6, 15.0)
    assert (theirs.frame, theirs.z) == (5, 503.0)
    assert (ours.lat_int, ours.lon_int) == (theirs.x, theirs.y) == (473977421, -85455941)
    assert theirs.param2 == 1.0


def test_speed_goes_with_px4s_command_and_after_ardupilots():
    assert PX4.go_command(PLACE, 488.0, 3.0, 1.0).param1 == 3.0
    assert PX4.command_after_go(3.0, VehicleState()) is None
    assert ARDUPILOT.command_after_go(3.0, VehicleState()) == CommandLong(
        MavCmd.DO_CHANGE_SPEED, param1=1.0, param2=3.0, param3=-1.0
    )


def test_both_are_sent_a_heading_and_ardupilot_is_set_to_use_it():
    assert PX4.go_command(PLACE, 488.0, 3.0, 1.0).param4 == 1.0
    target = ARDUPILOT.go_command(PLACE, 488.0, 3.0, 1.0)
    assert (target.yaw, target.type_mask & 0x400, target.type_mask & 0x800) == (1.0, 0, 0x800)
