"""The priority of a recorder: it has what robots and commands leave."""

import os
import subprocess
import sys

from fleet.record import priority

PROGRAM = """
import os, pathlib, threading
from fleet.record import priority
priority.AUTOGROUP = pathlib.Path({file!r})
priority.lower_priority()
niceness = []
thread = threading.Thread(target=lambda: niceness.append(os.getpriority(os.PRIO_PROCESS, 0)))
thread.start()
thread.join()
print(niceness[0])
"""


def lower_priority(file, *, leads):
    """Run a program that gives way, and leads a session of its own or not; returns its niceness then."""
    program = PROGRAM.format(file=str(file))
    command = [sys.executable, "-c", program]
    result = subprocess.run(command, capture_output=True, check=True, start_new_session=leads)
    return int(result.stdout)


def test_each_thread_of_it_gives_way_and_its_session_if_it_leads_one(tmp_path):
    expected = min(19, os.getpriority(os.PRIO_PROCESS, 0) + priority.NICE)
    assert lower_priority(tmp_path / "autogroup", leads=False) == expected
    assert not (tmp_path / "autogroup").exists()
    assert lower_priority(tmp_path / "autogroup", leads=True) == expected
    assert (tmp_path / "autogroup").read_text() == f"{priority.NICE}\n"


def test_a_kernel_without_groups_of_sessions_is_no_problem(tmp_path):
    assert lower_priority(tmp_path / "none" / "autogroup", leads=True) > 0
