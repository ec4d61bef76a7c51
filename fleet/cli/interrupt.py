"""Ctrl-C while nothing is under way that would have to be ended: the process ends at once, without a word.

Python's own handler raises KeyboardInterrupt wherever the program is: in the middle of an import, or of the
interpreter's end, that is a page of text. This module is the first to be imported, and loads nothing: the
module ``signal`` would take a while in which Ctrl-C finds Python's handler.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # the C part of ``signal``; typeshed has none

INTERRUPTED = 130  # as a shell tells it: 128 and the number of SIGINT


def end_at_once() -> bool:
    """Let Ctrl-C end the process from now on, where it raises KeyboardInterrupt; return whether it did.

    One that ignores it (nohup, a job behind a shell), or has a handler of its own, goes on as it is.
    """
    if _signal.getsignal(_signal.SIGINT) is not _signal.default_int_handler:
        return False
    try:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
    except ValueError:  # another thread than the main one: signals are not its business
        return False
    return True


def raise_from_now_on() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again."""
    if _signal.getsignal(_signal.SIGINT) == _signal.SIG_DFL:
        _signal.signal(_signal.SIGINT, _signal.default_int_handler)
