"""Who has the vehicle."""

import pytest

from fleet import NotReady, Refused, TimedOut, Unsupported
from fleet_mavlink.authority import Authority
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import VehicleState

PX4 = Px4()


class Watched:
    """An authority, and the reasons for which it was lost."""

    def __init__(self):
        self.reasons = []
        self.authority = Authority(self.reasons.append)

    def observe(self, *modes, armed=True, status=4):
        for mode in modes:
            beat = Heartbeat(2, 12, 0x80 if armed else 0, PX4.number_of(mode), status)
            self.authority.observe(VehicleState(heartbeat=beat), PX4)
        return self


@pytest.fixture
def watched():
    return Watched()


def test_a_mode_that_we_asked_for_is_ours(watched):
    watched.observe("AUTO.LOITER")
    watched.authority.expect("OFFBOARD")
    watched.observe("AUTO.LOITER", "OFFBOARD", "OFFBOARD")
    assert watched.reasons == []
    assert watched.authority.lost_to == ""


def test_a_mode_that_we_did_not_ask_for_is_reported_once(watched):
    watched.observe("AUTO.LOITER", "POSCTL", "POSCTL", "ALTCTL")
    assert watched.reasons == [
        "mode changed from AUTO.LOITER to POSCTL, not by us: a pilot or another station"
    ]
    assert watched.authority.lost_to == "ALTCTL"


def test_who_arms_it_has_it_from_then_on(watched):
    watched.observe("AUTO.TAKEOFF", armed=False)
    watched.authority.armed_by("ground station 255/190")
    watched.observe("AUTO.TAKEOFF", armed=False)
    assert watched.reasons == []
    watched.observe("AUTO.TAKEOFF")
    assert watched.reasons == ["ground station 255/190 commands it"]
    assert watched.authority.taker == "AUTO.TAKEOFF: commanded by ground station 255/190"


def test_an_arming_that_we_ask_for_later_is_ours(watched):
    watched.authority.armed_by("ground station 255/190")
    watched.authority.expect("AUTO.TAKEOFF")
    watched.observe("AUTO.TAKEOFF", armed=False).observe("AUTO.TAKEOFF")
    assert watched.reasons == []


def test_a_fail_safe_is_reported_as_what_it_is(watched):
    watched.observe("AUTO.LOITER").observe("AUTO.RTL", status=5)
    assert watched.reasons[0].endswith("its own fail-safe")


def test_it_is_ours_again_once_a_command_of_ours_was_carried_out(watched):
    watched.observe("AUTO.LOITER", "POSCTL")
    with watched.authority.requesting("AUTO.LOITER"):
        assert watched.authority.lost_to == "POSCTL"
        watched.observe("POSCTL", "AUTO.LOITER")
    assert watched.authority.lost_to == ""
    watched.observe("POSCTL")
    assert len(watched.reasons) == 2


@pytest.mark.parametrize("error", [Refused, NotReady, Unsupported])
def test_a_command_that_the_autopilot_refuses_gives_nothing_back_and_is_expected_no_more(watched, error):
    watched.observe("AUTO.LOITER", "POSCTL")
    with pytest.raises(error), watched.authority.requesting("AUTO.RTL"):
        raise error("no position", device_result="TEMPORARILY_REJECTED")
    assert watched.authority.lost_to == "POSCTL"
    watched.observe("AUTO.LOITER").observe("AUTO.LOITER", armed=False).observe("AUTO.LOITER", "AUTO.RTL")
    assert watched.authority.lost_to == "AUTO.RTL"


def test_a_command_without_an_answer_gives_nothing_back_and_may_still_be_obeyed(watched):
    watched.observe("AUTO.LOITER")
    with pytest.raises(TimedOut), watched.authority.requesting("AUTO.RTL"):
        raise TimedOut("it does not change")
    watched.observe("AUTO.RTL")
    assert watched.reasons == []


def test_the_end_of_a_takeoff_is_no_surprise(watched):
    watched.observe("AUTO.TAKEOFF", "AUTO.LOITER")
    assert watched.reasons == []


def test_a_pilot_may_choose_any_mode_on_the_ground(watched):
    watched.observe("AUTO.LOITER", "POSCTL", "MANUAL", armed=False)
    assert watched.reasons == []
    assert watched.authority.lost_to == ""


def test_landing_it_gives_it_back(watched):
    watched.observe("AUTO.LOITER", "POSCTL").observe("POSCTL", armed=False)
    assert watched.authority.lost_to == ""


@pytest.mark.parametrize(("mode", "lost_to"), [("POSCTL", "POSCTL"), ("OFFBOARD", ""), ("AUTO.LOITER", "")])
def test_a_vehicle_met_in_flight_is_the_pilots_when_he_flies_it(watched, mode, lost_to):
    watched.observe(mode)
    assert watched.authority.lost_to == lost_to
    assert watched.reasons == []


def test_what_was_asked_for_just_before_may_still_be_shown_first(watched):
    watched.observe("AUTO.LOITER")
    for mode in ("OFFBOARD", "AUTO.LOITER", "AUTO.LAND"):
        watched.authority.expect(mode)
    watched.observe("OFFBOARD", "AUTO.LOITER", "AUTO.LAND")
    assert watched.reasons == []
    watched.observe("OFFBOARD", "OFFBOARD")
    assert len(watched.reasons) == 1


def test_a_heartbeat_from_before_a_request_does_not_make_the_request_before_it_a_strangers(watched):
    watched.observe("AUTO.LOITER")
    for mode in ("AUTO.LAND", "AUTO.LOITER"):
        watched.authority.expect(mode)
    watched.observe("AUTO.LOITER", "AUTO.LAND", "AUTO.LOITER")  # the first was on its way already
    assert watched.reasons == []


def test_what_was_asked_for_before_and_is_not_shown_for_seconds_is_expected_no_more(watched):
    watched.observe("AUTO.LOITER")
    for mode in ("AUTO.LAND", "AUTO.LOITER"):
        watched.authority.expect(mode)
    watched.observe(*["AUTO.LOITER"] * 4, "AUTO.LAND")
    assert len(watched.reasons) == 1


def test_a_heartbeat_that_was_overtaken_on_its_way_shows_no_stranger(watched):
    watched.observe("AUTO.LOITER")
    for mode in ("AUTO.LAND", "AUTO.LOITER"):
        watched.authority.expect(mode)
        watched.observe(mode)
    watched.observe("AUTO.LAND", "AUTO.LOITER")
    assert watched.reasons == []
    watched.observe("AUTO.LAND", "AUTO.LAND")
    assert len(watched.reasons) == 1


def test_a_mode_that_was_left_seconds_ago_is_a_strangers_at_once(watched):
    watched.observe("AUTO.LOITER")
    for mode in ("AUTO.LAND", "AUTO.LOITER"):
        watched.authority.expect(mode)
        watched.observe(mode)
    watched.observe("AUTO.LOITER", "AUTO.LOITER", "AUTO.LOITER", "AUTO.LAND")
    assert len(watched.reasons) == 1
