"""Ctrl-C during start-up: the process ends at once, without a traceback.

Python's own handler raises KeyboardInterrupt anywhere, for example during an import or at the end of the
interpreter, which prints a long traceback. This module is imported first, and imports nothing itself: while
the module ``signal`` loads, Ctrl-C would still reach Python's handler.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # the C part of ``signal``; typeshed has none

INTERRUPTED = 130  # as in shells: 128 plus the number of SIGINT


def end_on_interrupt() -> bool:
    """Let Ctrl-C end the process, if it would raise KeyboardInterrupt; return True if changed.

    A process that ignores it (nohup, a background job), or that has a handler of its own, stays as it is.
    """
    if _signal.getsignal(_signal.SIGINT) is not _signal.default_int_handler:
        return False
    try:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
    except ValueError:  # not the main thread, which alone handles signals
        return False
    return True


def restore_interrupt() -> None:
    """Restore KeyboardInterrupt for Ctrl-C."""
    if _signal.getsignal(_signal.SIGINT) == _signal.SIG_DFL:
        _signal.signal(_signal.SIGINT, _signal.default_int_handler)
