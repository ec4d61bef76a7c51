from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.age import SESSIONS, AgeCheck

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


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(0, 3600)), max_size=30), st.floats(0, 2))
def test_nothing_older_than_age_and_skew_ever_passes(messages, skew):
    ages = AgeCheck(skew)
    now = 0.0
    for lag, wait in messages:
        now += wait
        if check(ages, lag, now=now):
            assert -skew - 0.5 - 1e-6 <= lag <= skew + 0.5 + 1e-6
