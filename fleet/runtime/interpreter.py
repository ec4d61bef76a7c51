"""Settings of the whole interpreter: the only place that changes them, and gives them back.

They hold for every thread and every program part of a process, so two owners would undo each other.
"""

from __future__ import annotations

import contextlib
import gc
import sys
import threading
from collections.abc import Iterator
from typing import NamedTuple

_lock = threading.Lock()
_holders = 0
_before: _Settings | None = None


class _Settings(NamedTuple):
    """What is given back."""

    switch_interval: float
    threshold: tuple[int, int, int]
    collects: bool

    @classmethod
    def current(cls) -> _Settings:
        return cls(sys.getswitchinterval(), gc.get_threshold(), gc.isenabled())

    def restore(self) -> None:
        sys.setswitchinterval(self.switch_interval)
        gc.set_threshold(*self.threshold)
        (gc.enable if self.collects else gc.disable)()
        gc.unfreeze()


@contextlib.contextmanager
def interpreter_settings(
    *, switch_interval: float | None = None, young: int | None = None, collect: bool = True
) -> Iterator[None]:
    """Change settings while the block runs; they are given back when the last such block ends.

    ``switch_interval``: seconds for which a thread keeps the interpreter while another wants it. ``young``:
    objects made and not yet freed after which the garbage collector looks at them. ``collect``: whether it
    runs by itself at all. What lives when the block begins is kept out of its sight.
    """
    _hold()
    try:
        if switch_interval is not None:
            sys.setswitchinterval(switch_interval)
        if young is not None:
            gc.set_threshold(young, *gc.get_threshold()[1:])
        collect_garbage()
        gc.freeze()
        if not collect:
            gc.disable()
        yield
    finally:
        _release()


def collect_garbage() -> None:
    """Free what nothing refers to any more, so that it is not kept for ever."""
    gc.collect()


def freeze_new_objects() -> None:
    """Keep out of the garbage collector's sight what has been made since the settings were changed."""
    with _lock:
        if _holders:
            gc.freeze()


def _hold() -> None:
    """Note the settings before the first change."""
    global _holders, _before  # noqa: PLW0603 - the interpreter is one, too
    with _lock:
        if not _holders:
            _before = _Settings.current()
        _holders += 1


def _release() -> None:
    """Give the settings back after the last change."""
    global _holders, _before  # noqa: PLW0603 - the interpreter is one, too
    with _lock:
        _holders -= 1
        if not _holders and _before is not None:
            _before.restore()
            _before = None
