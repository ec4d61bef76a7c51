"""The thread that reads from the broker while the loop does not: often, and whatever one check raises."""

import threading

from fleet.cloud.fallback_reader import BUSY, PERIOD, FallbackReader
from tests.tools.waiting import DEADLINE


class Waits:
    """Stands for the event that ends the thread: notes how long it is waited for, and ends after some."""

    def __init__(self, number):
        self.number, self.waited = number, []

    def wait(self, seconds):
        self.waited.append(seconds)
        return len(self.waited) > self.number


def checked(*findings):
    """Let a reader check once for each finding; return how long it waited before each check, and the end."""
    left = list(findings)

    def poll():
        found = left.pop(0)
        if isinstance(found, Exception):
            raise found
        return found

    reader = FallbackReader(poll)
    reader._ended = waits = Waits(len(findings))
    reader._run()
    assert left == []
    return waits.waited


def test_more_is_looked_for_soon_after_something_was_found():
    assert checked(False, True, True, False) == [PERIOD, PERIOD, BUSY, BUSY, PERIOD]


def test_a_check_that_fails_is_logged_and_ends_nothing(caplog):
    assert checked(True, OSError("the socket is gone"), False) == [PERIOD, BUSY, PERIOD, PERIOD]
    assert "the fallback reader failed" in caplog.text
    assert "the socket is gone" in caplog.text


def test_it_reads_on_a_thread_of_its_own_which_no_process_waits_for():
    threads, read = [], threading.Event()

    def poll():
        threads.append(threading.current_thread())
        read.set()
        return False

    reader = FallbackReader(poll)
    reader.start()
    try:
        assert read.wait(DEADLINE)
    finally:
        reader.stop()
    assert threads[0] is not threading.current_thread()
    assert threads[0].daemon
    threads[0].join(DEADLINE)
    assert not threads[0].is_alive()


def test_its_stop_does_not_wait_for_a_check_in_progress():
    checking, free = threading.Event(), threading.Event()

    def poll():
        checking.set()
        free.wait(DEADLINE)
        return True

    reader = FallbackReader(poll)
    reader.start()
    assert checking.wait(DEADLINE)
    reader.stop()
    assert reader._thread.is_alive()
    free.set()
    reader._thread.join(DEADLINE)
    assert not reader._thread.is_alive()


def test_an_emergency_stop_waits_a_hundredth_of_a_second_at_most_for_its_first_check():
    assert max(checked(False, False)) <= 0.01
