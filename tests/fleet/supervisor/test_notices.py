"""Lines of the supervisor for a person: printed by the way, never waited for."""

import signal
import sys
import threading

import pytest

from fleet.supervisor.notices import print_in_thread, reason_of


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (0, "exit code 0"),
        (3, "exit code 3"),
        (-signal.SIGKILL, "killed by SIGKILL"),
        (-signal.SIGSEGV, "killed by SIGSEGV"),
        (-200, "killed by signal 200"),
    ],
)
def test_how_a_process_ended_is_told_in_words(code, reason):
    assert reason_of(code) == reason


def test_a_line_is_printed_with_who_says_it(capsys):
    print_in_thread("the edge ended")
    for thread in threading.enumerate():
        if thread.name == "fleet-print":
            thread.join(20)
    assert capsys.readouterr() == ("", "fleet: the edge ended\n")


class Terminal:
    """A terminal that hangs until it is let go, or that fails."""

    def __init__(self, error=None):
        self.error = error
        self.go = threading.Event()
        self.threads = []

    def write(self, _text):
        self.threads.append(threading.current_thread())
        if self.error:
            raise self.error
        assert self.go.wait(20)

    def flush(self):
        self.flushed = True


def test_a_terminal_that_hangs_keeps_nobody(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    print_in_thread("the edge ended")
    terminal.go.set()
    (thread,) = terminal.threads
    thread.join(20)
    assert terminal.flushed
    assert thread.daemon, "it does not keep the supervisor from ending either"


def test_a_terminal_that_is_gone_is_no_error(monkeypatch):
    terminal = Terminal(BrokenPipeError())
    monkeypatch.setattr(sys, "stderr", terminal)
    print_in_thread("the edge ended")
    terminal.threads[0].join(20)


def test_a_supervisor_that_can_start_no_thread_for_its_lines_goes_on(monkeypatch):
    def fail(_thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", fail)
    print_in_thread("the edge ended")
