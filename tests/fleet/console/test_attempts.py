"""Failed logins: how long the next try waits, by name and by address, in bounded memory."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.console.attempts import BY_ADDRESS, BY_NAME, FORGET, MOST, AttemptLimit, Attempts, address_key

LIMIT = AttemptLimit(3, 60.0)


def test_a_few_failures_are_free_and_each_further_one_doubles_the_wait():
    attempts = Attempts(LIMIT)
    assert [attempts.fail("anna", 0.0) for _ in range(6)] == [0.0, 0.0, 0.0, 2.0, 4.0, 8.0]
    assert attempts.wait("anna", 1.0) == 7.0
    assert attempts.wait("anna", 8.0) == 0.0
    assert attempts.wait("ben", 1.0) == 0.0


@given(st.integers(1, 400), st.sampled_from([BY_NAME, BY_ADDRESS]))
def test_the_wait_never_grows_beyond_its_limit(failures, limit):
    attempts = Attempts(limit)
    waits = [attempts.fail("anna", 0.0) for _ in range(failures)]
    assert waits == sorted(waits)
    assert max(waits) <= limit.longest


def test_nobody_is_kept_out_by_others_for_more_than_a_minute_by_name():
    assert BY_NAME.longest == 60.0


def test_a_login_clears_the_failures_of_a_name_and_time_forgets_them():
    attempts = Attempts(LIMIT)
    for _ in range(5):
        attempts.fail("anna", 0.0)
    attempts.clear("anna")
    assert attempts.wait("anna", 0.0) == 0.0
    for _ in range(5):
        attempts.fail("anna", 0.0)
    assert attempts.fail("anna", FORGET) == 0.0


def test_memory_is_bounded_and_the_oldest_failure_goes_first():
    attempts = Attempts(AttemptLimit(0, 60.0))
    for number in range(MOST + 1):
        attempts.fail(str(number), 0.0)
    assert attempts.wait("0", 0.0) == 0.0
    assert attempts.wait("1", 0.0) > 0.0


@pytest.mark.parametrize(
    ("address", "key"),
    [
        ("10.0.0.9", "10.0.0.9"),
        ("::ffff:10.0.0.9", "10.0.0.9"),
        ("2001:db8:1:2:aaaa::1", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", "unknown"),
    ],
)
def test_an_address_counts_as_the_network_that_one_computer_has(address, key):
    assert address_key(address) == key
