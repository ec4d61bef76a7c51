"""Which signals a supervisor takes, and that it gives them back."""

import signal

import pytest

from fleet.supervisor.signals import handled_signals


@pytest.fixture(autouse=True)
def _not_ignored():
    """Handle SIGHUP by default, also where nohup runs the tests."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


def test_a_signal_is_handled_inside_the_block_and_as_before_behind_it():
    before = signal.getsignal(signal.SIGHUP)
    taken = []
    with handled_signals(taken.append):
        signal.raise_signal(signal.SIGHUP)
    assert taken == [signal.SIGHUP]
    assert signal.getsignal(signal.SIGHUP) is before


def test_a_signal_that_was_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    taken = []
    try:
        with handled_signals(taken.append):
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert taken == []
