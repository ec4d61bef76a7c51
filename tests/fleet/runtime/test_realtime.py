"""Real-time priority: of the loop and of the threads that act while it is stuck, or of none."""

import os
import subprocess
import sys

import pytest

from fleet.runtime import realtime
from fleet.runtime.realtime import LOOP, WATCHER, prefer_loop, prefer_watcher

RR = os.SCHED_RR | os.SCHED_RESET_ON_FORK
PROGRAM = """
import os, threading
from fleet.host.runtime.threads import run_in_thread
from fleet.runtime.realtime import prefer_loop

found = {}
def note(who):
    found[who] = os.sched_getparam(0).sched_priority
granted = prefer_loop()
note("loop")
run_in_thread(lambda: note("halting thread"), wait=20)
other = threading.Thread(target=note, args=("other thread",))
other.start()
other.join()
print(granted, found["loop"], found["halting thread"], found["other thread"])
"""


@pytest.fixture
def asked(monkeypatch):
    """Record what the system is asked for; it grants priorities up to ``asked.most``."""

    class Asked(list):
        most = 99

        def set_scheduler(self, process, policy, parameters):
            if parameters.sched_priority > self.most:
                raise PermissionError
            self.append((process, policy, parameters.sched_priority))

    asked = Asked()
    monkeypatch.setattr(realtime, "_in_force", False)
    monkeypatch.setattr(os, "sched_setscheduler", asked.set_scheduler)
    return asked


def test_a_watcher_and_the_supervisor_precede_the_loop(asked):
    assert prefer_loop(supervisor=77)
    prefer_watcher()
    assert asked[-3:] == [(0, RR, LOOP), (77, RR, WATCHER), (0, RR, WATCHER)]
    assert LOOP < WATCHER


@pytest.mark.parametrize("most", [0, LOOP])
def test_the_loop_has_no_priority_where_its_watchers_cannot_precede_it(asked, most):
    """A stuck loop would keep them from halting robots."""
    asked.most = most
    assert not prefer_loop(supervisor=77)
    prefer_watcher()
    assert asked == []


def test_nothing_is_asked_for_unless_the_loop_asks(asked):
    prefer_watcher()
    assert asked == []


def test_a_system_without_these_policies_is_no_error(monkeypatch):
    monkeypatch.setattr(realtime, "_in_force", False)
    monkeypatch.delattr(os, "sched_setscheduler")
    assert not prefer_loop()


def test_the_system_is_asked_for_these_threads_alone():
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60
    )
    assert result.stdout.split() in (["True", "1", "2", "0"], ["False", "0", "0", "0"])
