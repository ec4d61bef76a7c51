"""Requests to a self-walking machine: repeated until its state shows them, and answered once."""

import pytest

from fleet import CanFrame
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk.requests import TAKEN, RequestTracker

STAND, SIT, RESET, HEIGHT = BodyRequest.STAND, BodyRequest.SIT, BodyRequest.RESET, BodyRequest.HEIGHT
OFF, STANDING = BodyMode.OFF, BodyMode.STANDING
FRAME = CanFrame(0x21, b"\x01")


def begun(request, number=1, now=0.0, *, frame=FRAME, refusal=""):
    tracker = RequestTracker()
    tracker.begin(number, request, frame, refusal, now)
    return tracker


def sent(tracker, until, mode=OFF, error="", *, every=0.03, begin=0.0):
    """Let cycles pass; return the times, in hundredths of a second, at which the frame was sent."""
    cycles = round((until - begin) / every)
    times = [begin + every * cycle for cycle in range(cycles + 1)]
    return [round(100 * now) for now in times if tracker.step(now, mode, error) == FRAME]


def answer(tracker):
    return tracker.answered, tracker.refusal


def test_without_a_request_nothing_is_sent():
    tracker = RequestTracker()
    assert (sent(tracker, 1.0), answer(tracker)) == ([], (0, ""))


def test_a_request_is_sent_at_once_and_at_most_ten_times_a_second():
    assert sent(begun(STAND), 0.5) == [0, 12, 24, 36, 48]


@pytest.mark.parametrize(
    ("request_", "mode"), [(key, mode) for key, modes in TAKEN.items() for mode in sorted(modes)]
)
def test_a_request_is_done_as_soon_as_the_state_shows_it(request_, mode):
    tracker = begun(request_, 7)
    assert sent(tracker, 0.04, mode) == [0], "once, whatever the state was before"
    assert answer(tracker) == (7, "")
    assert sent(tracker, 1.0, mode, begin=0.1) == []


@pytest.mark.parametrize("request_", TAKEN)
def test_a_request_that_is_not_taken_in_a_second_fails_with_what_is_seen_instead(request_):
    names = {STAND: "stand_up", SIT: "sit_down", BodyRequest.RECOVER: "recovery_stand"}
    other = BodyMode.CHECKING
    tracker = begun(request_, 7)
    sent(tracker, 0.99, other)
    assert answer(tracker) == (0, "")
    sent(tracker, 1.04, other, begin=1.02)
    assert answer(tracker) == (7, f"{names[request_]} was not taken within 1 s: it is checking")


def test_the_machines_error_is_told_beside_a_request_that_it_does_not_take():
    tracker = begun(STAND, 7)
    sent(tracker, 1.1, OFF, "motor hot (error 3)")
    assert tracker.refusal == "stand_up was not taken within 1 s: it is off, motor hot (error 3)"


def test_a_reset_is_done_when_no_error_is_left():
    tracker = begun(RESET, 7)
    assert len(sent(tracker, 0.5, OFF, "motor hot")) == 5
    assert answer(tracker) == (0, "")
    sent(tracker, 0.6, OFF, "", begin=0.52)
    assert answer(tracker) == (7, "")
    tracker = begun(RESET, 8)
    sent(tracker, 1.1, OFF, "motor hot")
    assert answer(tracker) == (8, "reset_faults was not taken within 1 s: it is off, motor hot")


def test_a_height_which_no_state_shows_is_sent_a_few_times():
    tracker = begun(HEIGHT, 7)
    assert sent(tracker, 1.0, STANDING) == [0, 12, 24]
    assert answer(tracker) == (7, "")


def test_what_is_refused_before_it_is_sent_is_answered_at_once():
    tracker = begun(STAND, 7, refusal="it has no bus")
    assert answer(tracker) == (7, "it has no bus")
    assert sent(tracker, 1.0) == []


def test_what_needs_no_frame_is_done_at_once():
    tracker = begun(STAND, 7, frame=None)
    assert (answer(tracker), sent(tracker, 1.0)) == ((7, ""), [])


def test_another_request_ends_the_one_before():
    tracker = begun(STAND, 7)
    sent(tracker, 0.06)
    other = CanFrame(0x22, b"\x02")
    tracker.begin(8, SIT, other, "", 0.08)
    assert answer(tracker) == (7, "another command came first")
    assert tracker.step(0.08, STANDING, "") == other, "at once"
    tracker.step(0.1, OFF, "")
    assert answer(tracker) == (8, "")


def test_a_stop_ends_a_request_with_its_reason_and_once():
    tracker = begun(STAND, 7)
    tracker.end("stopped")
    assert answer(tracker) == (7, "stopped")
    tracker.end("again")
    assert (answer(tracker), sent(tracker, 1.0)) == ((7, "stopped"), [])
