import logging
import threading

from fleet.runtime.rate_limited_counter import (
    LOG_EVERY,
    LONGEST,
    MOST_REASONS,
    RateLimit,
    RateLimitedCounter,
)
from fleet.testing.clock import ManualClock


def counter():
    clock = ManualClock()
    return RateLimitedCounter(logging.getLogger("fleet.test"), clock), clock


def test_each_reason_is_counted_and_reported_on_its_own(caplog):
    refusals, _ = counter()
    for _ in range(3):
        refusals.add("too large", "%d bytes", 5)
        refusals.add("retained", "on %s", "t")
    assert refusals.counts() == {"too large": 3, "retained": 3}
    assert refusals.total == 6
    assert caplog.messages == ["5 bytes", "on t"]


def test_after_a_minute_a_reason_is_reported_again_with_how_many_there_were(caplog):
    refusals, clock = counter()
    for _ in range(10):
        refusals.add("retained", "on %s", "100%")
    clock.advance(LOG_EVERY)
    refusals.add("retained", "on %s", "x")
    clock.advance(LOG_EVERY)
    refusals.add("retained", "on %s", "y")
    assert caplog.messages == ["on 100%", "on x (9 more like this before)", "on y"]


def test_reasons_without_end_fill_neither_the_log_nor_the_memory(caplog):
    refusals, clock = counter()
    for number in range(100_000):
        refusals.add(str(number), "line")
        if number == 50_000:
            clock.advance(LOG_EVERY)
    assert len(caplog.messages) <= MOST_REASONS + 2
    assert len(refusals.counts()) == MOST_REASONS + 1
    assert refusals.total == 100_000
    assert "more like this before" in caplog.messages[-1]


def test_whoever_chooses_the_words_does_not_choose_how_many(caplog):
    refusals, _ = counter()
    refusals.add("unreadable", "on %s", "x" * 1_000_000)
    assert len(caplog.messages[0]) < 2 * LONGEST


def test_nothing_is_lost_when_many_threads_count():
    refusals, _ = counter()
    threads = [
        threading.Thread(target=lambda: [refusals.add("x", "line") for _ in range(2000)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert refusals.counts() == {"x": 8000}


def test_no_more_than_is_allowed_passes_within_any_minute():
    allowance, passed = RateLimit(2), []
    for now in range(200):
        if not allowance.is_used(now):
            allowance.use(now)
            passed.append(now)
    assert passed == [0, 1, 60, 61, 120, 121, 180, 181]
