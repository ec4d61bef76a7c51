"""Logins in the history of the edge."""

import asyncio

import pytest

from fleet.console.login_history import FAILURES, WINDOW, HistoryPlace, LoginHistory
from fleet.history.event_filter import EventFilter
from fleet.history.reader import read
from fleet.model.event import EventKind, Severity
from fleet.testing.clock import ManualClock


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def history(tmp_path, clock):
    return LoginHistory(HistoryPlace(str(tmp_path), 1 << 20, 86400.0), clock)


def waiting(history):
    return history._history.waiting()


def test_who_came_in_is_proven_and_who_failed_is_not(history):
    history.logged_in("anna", "10.0.0.9")
    history.failed("anna", "10.0.0.8", 4.0)
    history.failed("", "10.0.0.8", 0.0)
    logged_in, failed, unknown = waiting(history)
    assert logged_in.text == "anna logged in at the console, from 10.0.0.9"
    assert (logged_in.kind, logged_in.severity, logged_in.asker.proven) == (
        EventKind.LOGIN,
        Severity.INFO,
        True,
    )
    assert failed.text == "a login at the console as anna failed, from 10.0.0.8; the next try waits 4 s"
    assert (failed.severity, failed.asker.name, failed.asker.proven) == (Severity.WARNING, "anna", False)
    assert unknown.text == "a login at the console with an unknown name failed, from 10.0.0.8"


def test_failures_are_bounded_by_the_minute_and_their_number_is_reported(history, clock):
    for _ in range(FAILURES + 5):
        history.failed("anna", "10.0.0.8", 0.0)
    assert len(waiting(history)) == FAILURES
    clock.advance(WINDOW)
    history.failed("anna", "10.0.0.8", 0.0)
    assert waiting(history)[-1].text.endswith("; 5 failures before were not written")


async def test_it_is_in_the_file_that_the_edge_reads(history, tmp_path):
    running = asyncio.create_task(history.run())
    await asyncio.sleep(0)
    history.logged_in("anna", "10.0.0.9")
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    (written,) = read(tmp_path, EventFilter())
    assert (written.kind, written.asker.name) == (EventKind.LOGIN, "anna")
