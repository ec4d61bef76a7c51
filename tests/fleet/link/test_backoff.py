import itertools

from hypothesis import given
from hypothesis import strategies as st

from fleet.link.backoff import backoff


def first(count, delays):
    return list(itertools.islice(delays, count))


def test_delays_double_up_to_the_longest():
    assert first(8, backoff(fraction=lambda: 0.0)) == [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0]


def test_jitter_only_shortens():
    assert first(4, backoff(jitter=0.5, fraction=lambda: 0.5)) == [0.375, 0.75, 1.5, 3.0]


@given(st.floats(0, 1, exclude_max=True), st.floats(0.01, 10), st.floats(10, 100))
def test_no_delay_is_longer_than_the_longest_or_zero(fraction, shortest, longest):
    for delay in first(20, backoff(shortest, longest, fraction=lambda: fraction)):
        assert 0 < delay <= longest


def test_two_robots_do_not_come_back_together():
    assert first(5, backoff()) != first(5, backoff())
