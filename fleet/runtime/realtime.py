"""Real-time priority for the event loop, and for the threads that act while the loop is stuck (sched(7)).

A thread of the normal policy that becomes runnable can wait for the rest of another one's time slice: with
50 drones on two processors, one velocity in a hundred was written 4.0 ms after the cloud's command, and 2.6
ms with real-time priority. Only a file that asks for it gets it (``edge.realtime``), since the loop then
precedes every normal program of the computer.
"""

from __future__ import annotations

import os

LOOP = 1
WATCHER = 2
"""Priorities of SCHED_RR, below those of the control loops of quadrupeds (40).

A watcher precedes the loop: on one processor, a stuck loop would otherwise keep it from halting robots.
"""

NOT_PERMITTED = "edge.realtime: no real-time priority: permit it with LimitRTPRIO=2 or CAP_SYS_NICE"

_in_force = False


def prefer_loop(supervisor: int = 0) -> bool:
    """Give the calling thread, which runs the event loop, real-time priority; return False if not permitted.

    ``supervisor`` is the process that halts the robots if this one dies; it gets the priority of a watcher.
    New threads and processes have the normal policy.
    """
    global _in_force  # noqa: PLW0603 - it holds for the process
    _in_force = _set(WATCHER) and _set(LOOP)
    if _in_force and supervisor:
        _set(WATCHER, supervisor)
    return _in_force


def prefer_watcher() -> None:
    """Give the calling thread priority over the event loop, if that has real-time priority."""
    if _in_force:
        _set(WATCHER)


def _set(priority: int, process: int = 0) -> bool:
    """Set the priority of a process's main thread, or with 0 of the calling thread; False if refused."""
    try:
        policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(process, policy, os.sched_param(priority))
    except (AttributeError, OSError):  # another system than Linux; not permitted
        return False
    return True
