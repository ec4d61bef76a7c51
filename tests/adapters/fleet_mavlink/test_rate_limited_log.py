"""Reasons are told once a minute, however often something is refused."""

import logging

from fleet.testing.clock import ManualClock
from fleet_mavlink.rate_limited_log import _MOST, RateLimitedLog


def test_each_reason_is_logged_once_a_minute_with_the_number_left_out(caplog):
    clock = ManualClock()
    notices = RateLimitedLog(logging.getLogger("desk"), clock.monotonic)
    assert notices.add("a", "first")
    assert notices.add("b", "other")
    assert not any(notices.add("a", "again") for _ in range(5))
    clock.advance(61.0)
    assert notices.add("a", "later")
    assert caplog.messages == ["first", "other", "later (5 more since)"]


def test_many_reasons_take_no_more_room(caplog):
    clock = ManualClock()
    notices = RateLimitedLog(logging.getLogger("desk"), clock.monotonic)
    for number in range(10 * _MOST):
        notices.add(f"reason {number}", "line")
    assert len(caplog.messages) == _MOST + 1
    assert len(notices._said) + len(notices._since) <= _MOST + 2
