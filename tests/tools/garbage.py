"""Test that a call leaves no reference cycles for the garbage collector."""

from __future__ import annotations

import gc
from collections.abc import Callable

TRIES = 5
"""Attempts. Other threads may leave objects at times; a call with a leak leaves some every time."""


def leaves_nothing(call: Callable[[], object]) -> bool:
    """Return whether everything that a call makes is gone when it returns."""
    collects = gc.isenabled()
    gc.freeze()  # what was there before is not looked at, which would take long
    gc.disable()
    try:
        return any(_left(call) == 0 for _ in range(TRIES))
    finally:
        gc.unfreeze()
        if collects:
            gc.enable()


def _left(call: Callable[[], object]) -> int:
    """Return the number of objects that a call leaves."""
    gc.collect()
    call()
    return gc.collect()
