import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import Level
from fleet_ugv.readiness import BoardPhase, Readiness


def make(*, confirms=True, guarded=True):
    return Readiness(confirms=confirms, guarded=guarded, now=0.0)


def test_a_board_that_answers_is_set_up_and_ready_when_it_confirms():
    board = make()
    assert board.refusal
    assert board.record_feedback(1.0, restarted=False)
    assert board.refusal
    board.confirmed()
    assert (board.phase, board.refusal, board.health.level) == (BoardPhase.READY, "", Level.OK)


def test_a_board_whose_dead_man_is_fixed_is_ready_at_once():
    board = make(confirms=False)
    assert board.record_feedback(1.0, restarted=False)
    assert board.phase is BoardPhase.READY


def test_a_board_without_a_dead_man_is_never_more_than_unguarded():
    board = make(confirms=False, guarded=False)
    board.record_feedback(1.0, restarted=False)
    assert board.phase is BoardPhase.UNGUARDED
    assert board.health.level is Level.DEGRADED


def test_a_board_that_does_not_confirm_is_asked_three_times_and_then_driven_slowly():
    board, requested = make(), 0
    for turn in range(100):
        now = turn * 0.1
        requested += board.record_feedback(now, restarted=False) or board.check(now)
    assert requested == 3
    assert board.phase is BoardPhase.UNGUARDED
    board.confirmed()
    assert board.phase is BoardPhase.READY


def test_silence_is_amber_within_a_second_and_red_within_three():
    board = make(confirms=False)
    board.record_feedback(1.0, restarted=False)
    board.check(2.0)
    assert (board.phase, board.health.level) == (BoardPhase.QUIET, Level.DEGRADED)
    assert not board.lost(3.0)
    assert board.lost(4.0)


def test_a_board_that_restarts_or_comes_back_is_set_up_again():
    board = make(confirms=False)
    board.record_feedback(1.0, restarted=False)
    assert not board.record_feedback(1.1, restarted=False)
    assert board.record_feedback(1.2, restarted=True)
    board.check(2.5)
    assert board.record_feedback(2.6, restarted=False)


@given(st.lists(st.tuples(st.sampled_from(["heard", "restarted", "confirmed", "look"]), st.floats(0.01, 2))))
def test_whatever_happens_it_is_never_driven_while_silent_or_before_its_setup(events):
    board, now, last = make(), 0.0, None
    for event, wait in events:
        now += wait
        if event == "confirmed":
            board.confirmed()
        elif event == "look":
            board.check(now)
        else:
            board.record_feedback(now, restarted=event == "restarted")
            last = now
        if event == "look" and not board.refusal:
            assert last is not None
            assert now - last <= 1.0


@pytest.mark.parametrize("phase", BoardPhase)
def test_every_phase_has_a_health(phase):
    board = make()
    board.phase = phase
    assert (board.health.level is Level.OK) == (phase is BoardPhase.READY)
