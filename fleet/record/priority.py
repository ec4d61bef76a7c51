"""Priority of a recorder's process: robots and their commands have precedence.

Measured, this decides the cost of recording: as long as the edge gets a processor whenever it needs one, its
commands take as long with a recorder as without (``bench record``).
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

NICE = 10
AUTOGROUP = Path("/proc/self/autogroup")
"""Priority of a session on a kernel with autogroup scheduling, in which niceness applies within a session."""


def lower_priority() -> None:
    """Lower the priority of this process, and of the session if it leads one, permanently.

    Call it before any thread is started: each thread has its own niceness. A session led by another process
    contains other programs, and keeps its priority.
    """
    os.nice(NICE)
    if os.getsid(0) == os.getpid():
        with contextlib.suppress(OSError):  # a kernel without it, or no /proc
            AUTOGROUP.write_text(f"{NICE}\n")
