"""Items of a plan on the wire, in whole numbers and in the older form in degrees."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.mission_items import ARDUPILOT_BEHAVIOUR, LOITER_TURNS, PX4_BEHAVIOUR, Item, item_of


def test_an_item_is_what_was_sent():
    message = mav.MAVLink_mission_item_int_message(
        1, 1, 4, 6, 16, 0, 1, 1.0, 2.0, 3.0, 4.0, 473977421, -85455941, 12.5
    )
    assert item_of(message) == Item(6, 16, 1, 1.0, 2.0, 3.0, 4.0, 473977421, -85455941, 12.5)


@pytest.mark.parametrize(("x", "y"), [(47.5, -8.25), (-33.5, 151.25)])
def test_an_item_of_the_older_form_has_degrees(x, y):
    message = mav.MAVLink_mission_item_message(1, 1, 4, 3, 16, 0, 1, 0, 0, 0, 0, x, y, 12.5)
    item = item_of(message)
    assert (item.x, item.y, item.z) == (x * 1e7, y * 1e7, 12.5)
    assert isinstance(item.x, int)


def test_each_autopilot_asks_for_items_by_its_own_message():
    for behaviour, name in ((ARDUPILOT_BEHAVIOUR, "MISSION_REQUEST"), (PX4_BEHAVIOUR, "MISSION_REQUEST_INT")):
        message = behaviour.request(255, 190, 3, 0)
        assert (message.get_type(), message.target_system, message.seq) == (name, 255, 3)


def test_only_ardupilot_flies_circles_by_their_number():
    assert LOITER_TURNS == mav.MAV_CMD_NAV_LOITER_TURNS
    assert LOITER_TURNS in ARDUPILOT_BEHAVIOUR.flies
    assert LOITER_TURNS not in PX4_BEHAVIOUR.flies
    assert PX4_BEHAVIOUR.flies < ARDUPILOT_BEHAVIOUR.flies


PLANNED = ("WAYPOINT", "LOITER_UNLIM", "LOITER_TIME", "RETURN_TO_LAUNCH", "LAND", "TAKEOFF", "LOITER_TO_ALT")


@pytest.mark.parametrize("name", PLANNED)
def test_both_autopilots_fly_the_items_that_a_plan_may_have(name):
    assert getattr(mav, f"MAV_CMD_NAV_{name}") in PX4_BEHAVIOUR.flies & ARDUPILOT_BEHAVIOUR.flies
