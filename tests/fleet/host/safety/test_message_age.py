import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.message_age import SESSIONS, SHOWN, AgeCheck

WALL = 1_800_000_000.0


def check(ages: AgeCheck, lag: float, *, now: float = 0.0, session: str = "s", ordered: bool = False) -> bool:
    """Return True when a message that lags ``lag`` seconds is let through."""
    wall = WALL + now
    refusal = ages.refusal(session, wall - lag, wall=wall, now=now, max_age=0.5, ordered=ordered)
    return refusal is None


def test_a_fresh_message_passes_and_an_old_one_does_not():
    ages = AgeCheck(2.0)
    assert check(ages, 0.05)
    assert not check(ages, 3.0, now=1.0)


def test_an_hour_old_first_message_is_not_taken_for_a_slow_clock():
    assert not check(AgeCheck(2.0), 3600.0)


def test_a_clock_that_is_a_little_slow_is_learned():
    ages = AgeCheck(2.0)
    assert check(ages, 1.5)
    assert check(ages, 1.6, now=1.0)
    assert not check(ages, 2.2, now=2.0)


def test_a_clock_that_is_fast_does_not_make_old_messages_young():
    ages = AgeCheck(2.0)
    assert check(ages, -1.0)
    assert not check(ages, 0.0, now=1.0)


def test_a_message_from_the_future_is_refused():
    assert not check(AgeCheck(2.0), -10.0)


def test_a_message_without_a_stamp_is_as_old_as_its_arrival():
    assert AgeCheck(2.0).refusal("s", None, wall=WALL, now=0.0, max_age=0.5) is None


def test_a_setpoint_that_was_overtaken_is_refused():
    ages = AgeCheck(2.0)
    assert check(ages, 0.0, now=1.0, ordered=True)
    assert not check(ages, 0.3, now=1.1, ordered=True)


def test_a_corrected_clock_is_followed_after_two_windows():
    ages = AgeCheck(2.0)
    assert check(ages, -1.5)
    assert not check(ages, 0.0, now=1.0)
    for now in range(61, 200, 10):
        check(ages, 0.0, now=float(now))
    assert check(ages, 0.0, now=200.0)


def test_sessions_beyond_the_bound_are_forgotten():
    ages = AgeCheck(2.0)
    for number in range(SESSIONS * 2):
        check(ages, 0.0, session=str(number))
    assert len(ages._sessions) == SESSIONS


@pytest.mark.parametrize("late", [0.31, 0.5, 0.75, 1.9, 60.0])
def test_a_stream_that_always_lags_more_than_the_skew_is_refused_with_what_it_lags(late):
    ages = AgeCheck(0.3)
    for step in range(200):
        now = step / 10
        wall = WALL + now
        refusal = ages.refusal("s", wall - late, wall=wall, now=now, max_age=0.5, ordered=True)
        assert f"{late:.2f} s behind, or the network delays it as much; clock_skew is 0.3 s" in (
            refusal or ""
        )


def test_a_stream_whose_first_message_was_held_up_goes_on_with_the_next():
    ages = AgeCheck(0.3)
    assert not check(ages, 0.6, ordered=True)
    assert check(ages, 0.05, now=0.1, ordered=True)
    assert check(ages, 0.5, now=0.6, ordered=True)


@pytest.mark.parametrize("ordered", [False, True])
def test_a_command_may_be_later_than_a_velocity(ordered):
    ages = AgeCheck(0.3)
    wall = WALL
    refusal = ages.refusal("s", wall - 2.0, wall=wall, now=0.0, max_age=5.0, ordered=ordered)
    assert bool(refusal) == ordered


def test_a_velocity_from_a_clock_that_is_ahead_is_refused_with_how_far():
    refusal = AgeCheck(0.3).refusal("s", WALL + 0.4, wall=WALL, now=0.0, max_age=0.5, ordered=True)
    assert refusal == (
        "stamped 0.40 s in the future; clock_skew is 0.3 s: set the clock, or allow more in fleet.yaml"
    )


def test_each_sender_s_offset_is_reported_for_those_heard_last():
    ages = AgeCheck(0.3)
    for number in range(SHOWN + 3):
        check(ages, number / 100, session=str(number))
    ages.stopped("stopper", WALL, wall=WALL, now=0.0)
    offsets = ages.offsets()
    assert offsets == {str(number): number / 100 for number in range(4, SHOWN + 3)}


def test_a_stop_of_nobody_known_bars_what_may_be_from_before_it():
    ages = AgeCheck(0.3)
    ages.stopped("", None, wall=WALL, now=0.0)
    assert not check(ages, 0.0, now=0.29)
    assert check(ages, 0.0, now=0.31)


def test_a_clock_that_is_set_back_after_a_stop_bars_nobody_for_long():
    ages = AgeCheck(0.3)
    ages.stopped("s", WALL, wall=WALL, now=0.0)
    ages.stopped("t", WALL, wall=WALL, now=0.0)
    for session in ("s", "t", "u"):
        wall = WALL - 3600.0
        assert ages.refusal(session, wall, wall=wall, now=5.0, max_age=0.5) is None


@given(
    offsets=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    same=st.booleans(),
    heard=st.booleans(),
    sent=st.floats(0, 2),
    stopped=st.floats(0, 2),
    delays=st.tuples(st.floats(0, 3), st.floats(0, 3)),
)
def test_no_velocity_that_was_sent_before_a_stop_runs_after_it(
    *, offsets, same, heard, sent, stopped, delays
):
    """Whose clocks are off by no more than the skew; the true time says what was sent when."""
    ages = AgeCheck(0.3)
    mine, theirs = offsets[0], offsets[0 if same else 1]
    driver, stopper = "driver", "driver" if same else "stopper"
    if heard:
        ages.refusal(driver, WALL - 9 + mine, wall=WALL - 9, now=-9.0, max_age=0.5, ordered=True)
    came, stop_came = sent + delays[0], stopped + delays[1]
    ages.stopped(stopper, WALL + stopped + theirs, wall=WALL + stop_came, now=stop_came)
    stamp, wall = WALL + sent + mine, WALL + came
    passes = ages.refusal(driver, stamp, wall=wall, now=came, max_age=0.5, ordered=True) is None
    if came >= stop_came and sent + 1e-6 < stopped:
        assert not passes


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(0, 3600)), max_size=30), st.floats(0, 2))
def test_nothing_older_than_age_and_skew_ever_passes(messages, skew):
    ages = AgeCheck(skew)
    now = 0.0
    for lag, wait in messages:
        now += wait
        if check(ages, lag, now=now):
            assert -skew - 0.5 - 1e-6 <= lag <= skew + 0.5 + 1e-6


def test_what_was_asked_before_a_stop_is_refused_though_many_others_were_heard_since():
    ages = AgeCheck(2.0)
    ages.stopped("s", WALL, wall=WALL, now=0.0)
    for number in range(SESSIONS):
        check(ages, 0.0, now=0.5, session=f"other {number}")
    assert not check(ages, 1.0, now=0.5)
    assert check(ages, 0.1, now=0.5)
