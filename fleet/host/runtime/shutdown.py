"""End of a process, which a hanging thread of an adapter must not prevent."""

from __future__ import annotations

import os
import sys
import threading
import time

THREAD_END_TIMEOUT = 2.0  # s for remaining threads to end by themselves


def shutdown(code: int) -> int:
    """Return the exit code once all threads have ended; if one hangs, exit at once."""
    end = time.monotonic() + THREAD_END_TIMEOUT
    others = [
        each for each in threading.enumerate() if not each.daemon and each is not threading.main_thread()
    ]
    for thread in others:
        thread.join(max(0.0, end - time.monotonic()))
    left = [thread.name for thread in others if thread.is_alive()]
    if left:
        sys.stderr.write(f"fleet: left without waiting for {', '.join(left)}: an adapter's threads go on\n")
        sys.stdout.flush()
        os._exit(code)
    return code
