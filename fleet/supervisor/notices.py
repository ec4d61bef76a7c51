"""Lines of the supervisor for the user, printed without ever blocking it."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading

PRINTED_WITHIN = 0.02  # s to wait for a line to be printed before going on


def print_in_thread(line: str) -> None:
    """Print a line to stderr from a thread of its own: a blocked terminal must not delay a halt.

    Where no thread can be started, as on a computer that has run out of them, the line is lost.
    """
    text = f"fleet: {line}\n"

    def write() -> None:
        with contextlib.suppress(OSError):
            sys.stderr.write(text)
            sys.stderr.flush()

    thread = threading.Thread(target=write, name="fleet-print", daemon=True)
    with contextlib.suppress(RuntimeError):
        thread.start()
        thread.join(PRINTED_WITHIN)


def reason_of(code: int) -> str:
    """Return how a process ended, as text."""
    if code >= 0:
        return f"exit code {code}"
    with contextlib.suppress(ValueError):
        return f"killed by {signal.Signals(-code).name}"
    return f"killed by signal {-code}"
