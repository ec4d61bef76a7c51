"""The priority of a recorder's process: robots and their commands have the processors first.

Measured, that is what recording costs a command: while the edge has the processors whenever it wants them,
its commands take as long with a recorder as without one (``bench record``).
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

NICE = 10
AUTOGROUP = Path("/proc/self/autogroup")
"""Where a session has its priority on a kernel that schedules by sessions: niceness counts within one."""


def give_way() -> None:
    """Lower the priority of this process, and of the session that it leads, if any, for good.

    To be called before any thread is started: each has a niceness of its own. A session that somebody else
    leads has other programs in it, and keeps its priority.
    """
    os.nice(NICE)
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError):  # a kernel without it, or no /proc
            AUTOGROUP.write_text(f"{NICE}\n")
