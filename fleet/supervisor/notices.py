"""What the supervisor tells people, without ever waiting for them."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading

TOLD_WITHIN = 0.02  # s that a line may take before what comes next goes on


def print_in_thread(line: str) -> None:
    """Tell a line on stderr, from a thread of its own: a terminal that is held up must hold up no halt."""
    text = f"fleet: {line}\n"

    def tell() -> None:
        with contextlib.suppress(OSError):
            sys.stderr.write(text)
            sys.stderr.flush()

    thread = threading.Thread(target=tell, name="fleet-told", daemon=True)
    thread.start()
    thread.join(TOLD_WITHIN)


def reason_of(code: int) -> str:
    """Say how a process ended."""
    if code >= 0:
        return f"exit code {code}"
    with contextlib.suppress(ValueError):
        return f"killed by {signal.Signals(-code).name}"
    return f"killed by signal {-code}"
