"""Why a vehicle is in a fail-safe, and what is wrong with its position: in words."""

import contextlib

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import GeoPoint
from fleet.testing.clock import ManualClock
from fleet_mavlink.failsafe_causes import FailsafeCause, cause, position_troubles
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.state import Fix, VehicleState
from fleet_mavlink.statustext import Sentence

CRITICAL, ACTIVE = 5, 4
FAILSAFE = VehicleState(heartbeat=Heartbeat(2, 3, system_status=CRITICAL))
WELL = VehicleState(heartbeat=Heartbeat(2, 3, system_status=ACTIVE))
FIX = Fix(GeoPoint(47.0, 8.0, 500.0), "3d", 12, None, None)
EVERY_ESTIMATE = 0x33


class Silent:
    """A link on which nothing is written."""

    url = "replay"


def causes_of(records):
    """Return (seconds, cause or troubles) of a recording, each when it is new."""
    clock, found = ManualClock(monotonic=0.0), []
    hub, failsafe = LinkHub(Silent(), clock, 255, 190), FailsafeCause()
    with contextlib.ExitStack() as claims:
        vehicle = claims.enter_context(hub.vehicle(1))
        began, looked = None, 0.0
        for stamp, frame in records:
            began = stamp if began is None else began
            clock.advance(max(0.0, stamp - began - clock.monotonic()))
            hub.receive(frame, None)
            now = clock.monotonic()
            if vehicle.kind is None or now - looked < 0.1:
                continue
            looked = now
            failsafe.observe(vehicle.state, vehicle.kind.mode_of(vehicle.state), vehicle.sentences, now)
            causes = (failsafe.text, *position_troubles(vehicle.state, now))
            if not found or found[-1][1] != causes:
                found.append((round(now, 1), causes))
    return found


def test_a_copters_loss_is_reported_within_a_second_and_its_fail_safe_with_its_reason(recording):
    causes = causes_of(recording("ap_copter_gps_loss"))
    first = next(at for at, (_, *troubles) in causes if troubles)
    assert first == pytest.approx(58.4, abs=1.0), "the receiver was switched off at 57.6"
    at, words = next((at, words) for at, words in causes if len(words) == 3)
    assert at == pytest.approx(65.6, abs=0.3)
    assert words[1] == "no satellite fix (3 satellites)"
    assert "its estimator lost horizontal velocity, position" in words[2]
    reasons = {words[0] for _, words in causes} - {""}
    assert any("EKF variance; EKF Failsafe: changed to LAND Mode" in each for each in reasons)
    assert not any("Cleared" in each for each in reasons)
    assert causes[-1][1] == ("",), "it is over at the end"


def test_px4s_loss_is_reported_within_a_second(recording):
    causes = causes_of(recording("px4_gps_loss"))
    first = next(at for at, (_, *troubles) in causes if troubles)
    assert first == pytest.approx(19.2, abs=1.0), "the receiver was switched off at 18.8"
    assert any("Failsafe activated" in words[0] for _, words in causes)
    assert any("its estimator lost" in words[-1] for _, words in causes)
    assert causes[-1][1] == ("",)


def test_each_step_of_a_battery_fail_safe_has_its_own_reason(recording):
    reasons = [words[0] for _, words in causes_of(recording("px4_battery_low")) if words[0]]
    assert "Critical battery" in reasons[0]
    assert any("Emergency battery level" in each for each in reasons)


def test_what_is_over_and_what_another_says_better_is_no_cause():
    said = [
        Sentence("EKF Failsafe Cleared", 2, 1.0),
        Sentence("EKF3 lane switch 1", 2, 1.0),
        Sentence("EKF primary changed:1", 2, 1.0),
        Sentence("Mode change failed: LOITER requires position", 4, 1.0),
        Sentence("GPS recovered", 2, 1.0),
        Sentence("Failsafe activated", 2, 1.1),
        Sentence("Failsafe activated: entering Hold for 5 seconds", 2, 1.2),
        Sentence("Switching to Hold is currently not available", 2, 1.3),
        Sentence("Landing at current position", 6, 1.3),
    ]
    assert cause(said, 0.0, 2.0) == "Failsafe activated: entering Hold for 5 seconds"
    assert cause(said, 5.0, 9.0) == ""


@pytest.mark.parametrize(("severity", "counts"), [(0, True), (4, True), (5, False), (7, False)])
def test_only_a_warning_or_worse_is_a_cause(severity, counts):
    assert cause([Sentence("Low battery", severity, 1.0)], 0.0, 2.0) == ("Low battery" if counts else "")


@pytest.mark.parametrize(("at", "counts"), [(0.9, False), (1.0, True), (2.0, True), (2.1, False)])
def test_only_what_is_said_in_time_is_a_cause(at, counts):
    assert bool(cause([Sentence("Low battery", 2, at)], 1.0, 2.0)) is counts


def test_a_cause_says_everything_once_in_order_and_the_last_four_of_many():
    said = [Sentence(text, 2, 1.0) for text in ("a", "b", "a", "c", "d", "e", "b")]
    assert cause(said[:4], 0.0, 2.0) == "a; b; c"
    assert cause(said, 0.0, 2.0) == "b; c; d; e"


@given(st.lists(st.sampled_from(["a", "ab", "abc", "b", "b c", "b cd", "c", "d"]), max_size=8))
def test_no_text_of_a_cause_is_the_beginning_of_another(texts):
    words = cause([Sentence(each, 2, 1.0) for each in texts], 0.0, 2.0).split("; ")
    assert not any(one != other and other.startswith(one) for one in words for other in words if one)
    assert len(words) <= 4
    assert len(set(words)) == len(words)


def observed(*steps):
    """Return the texts of a cause after each step: its state, mode, what was said by then, and when."""
    failsafe, texts = FailsafeCause(), []
    for state, mode, said, now in steps:
        failsafe.observe(state, mode, said, now)
        texts.append(failsafe.text)
    return texts


LOW = Sentence("Battery low", 2, 9.0)
LATER = Sentence("Failsafe: RTL", 2, 10.7)
LATEST = Sentence("Bad compass", 2, 11.5)


def test_without_a_fail_safe_there_is_no_cause():
    assert observed((VehicleState(), "", [LOW], 9.5), (WELL, "LOITER", [LOW], 10.0)) == ["", ""]


def test_a_reason_is_taken_from_the_texts_of_three_seconds_before_to_08_after():
    before = [Sentence("Long ago", 2, 6.9), Sentence("Vibration", 2, 7.0)]
    told = observed(
        (FAILSAFE, "LOITER", before, 10.0),
        (FAILSAFE, "LOITER", [*before, LATER], 10.75),
        (FAILSAFE, "LOITER", [*before, LATER, LATEST], 11.5),
    )
    assert told == ["Vibration", "Vibration; Failsafe: RTL", "Vibration; Failsafe: RTL"]


def test_a_change_of_mode_within_a_fail_safe_has_a_reason_of_its_own():
    told = observed((FAILSAFE, "LOITER", [LOW], 10.0), (FAILSAFE, "RTL", [LOW, LATEST], 13.0))
    assert told == ["Battery low", "Bad compass"]


def test_a_change_of_mode_without_a_reason_keeps_the_one_before():
    assert observed((FAILSAFE, "LOITER", [LOW], 10.0), (FAILSAFE, "RTL", [LOW], 60.0))[-1] == "Battery low"


def test_the_cause_ends_with_the_fail_safe_and_the_next_one_has_none_of_it():
    told = observed(
        (FAILSAFE, "RTL", [LOW], 10.0), (WELL, "RTL", [LOW], 20.0), (FAILSAFE, "RTL", [LOW], 30.0)
    )
    assert told == ["Battery low", "", ""]


def test_a_reason_is_settled_once_no_more_of_it_is_expected():
    failsafe = FailsafeCause()
    assert failsafe.settled(0.0)
    failsafe.observe(FAILSAFE, "RTL", [], 10.0)
    assert [failsafe.settled(now) for now in (10.0, 10.75, 10.85)] == [False, False, True]
    failsafe.observe(WELL, "RTL", [], 10.1)
    assert failsafe.settled(10.1)


def test_a_vehicle_that_never_had_a_position_has_not_lost_it():
    assert position_troubles(VehicleState(satellites=0, estimator_flags=0), 100.0) == ()


FIXED = VehicleState(fix=FIX, fix_at=10.0, had_fix=True, satellites=12)


@pytest.mark.parametrize(("now", "troubles"), [(15.0, ()), (15.1, ("no satellite fix (12 satellites)",))])
def test_a_receiver_that_is_silent_for_five_seconds_has_lost_its_fix(now, troubles):
    assert position_troubles(FIXED, now) == troubles


def test_a_lost_fix_is_told_with_the_satellites_if_they_are_known():
    lost = msgspec.structs.replace(FIXED, fix=None)
    assert position_troubles(msgspec.structs.replace(lost, satellites=0), 10.0) == (
        "no satellite fix (0 satellites)",
    )
    assert position_troubles(msgspec.structs.replace(lost, satellites=None), 10.0) == ("no satellite fix",)


@pytest.mark.parametrize(
    ("flags", "missing"),
    [
        (EVERY_ESTIMATE, None),
        (EVERY_ESTIMATE & ~0x10, "position"),
        (0x10, None),  # what else is missing is told only with a lost position
        (0x01 | 0x20, "horizontal velocity, position"),
        (0x02, "attitude, position, height"),
        (0, "attitude, horizontal velocity, position, height"),
    ],
)
def test_an_estimator_that_lost_the_position_tells_what_it_lacks(flags, missing):
    troubles = position_troubles(VehicleState(had_estimate=True, estimator_flags=flags), 1.0)
    words = f"its estimator lost {missing}: its reported position is not reliable"
    assert troubles == ((words,) if missing else ())
