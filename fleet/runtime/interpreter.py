"""Settings of the whole interpreter: the only place that changes and restores them.

They apply to all threads and parts of a process, so two owners would undo each other's changes.
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
    """The settings to restore."""

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
    """Change settings while the block runs; they are restored when the last such block ends.

    ``switch_interval``: seconds for which a thread keeps the interpreter while another wants it. ``young``:
    threshold of the garbage collector's youngest generation, in objects. ``collect``: whether automatic
    collection is on. Objects that exist when the block begins are frozen: the collector ignores them.
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
    """Run a full collection, so that freezing does not keep garbage for ever."""
    gc.collect()


def freeze_new_objects() -> None:
    """Freeze the objects created since the change of settings: the garbage collector ignores them."""
    with _lock:
        if _holders:
            gc.freeze()


def _hold() -> None:
    """Save the settings before the first change."""
    global _holders, _before  # noqa: PLW0603 - the interpreter is global too
    with _lock:
        if not _holders:
            _before = _Settings.current()
        _holders += 1


def _release() -> None:
    """Restore the settings after the last change."""
    global _holders, _before  # noqa: PLW0603 - the interpreter is global too
    with _lock:
        _holders -= 1
        if not _holders and _before is not None:
            _before.restore()
            _before = None
