"""Answers of one drive in a cycle, and detection of two drives with the same id."""

from __future__ import annotations

_CERTAIN = 5  # consecutive cycles with two answers: late and repeated frames cannot explain them


class DriveAnswers:
    """Answers from one id. Two different answers in cycle after cycle come from two drives.

    ``doubled``: two drives certainly share this id; never reset.
    """

    __slots__ = ("_cycles", "_data", "_differ", "complete", "doubled")

    def __init__(self) -> None:
        self.complete = self.doubled = False
        self._data = b""
        self._differ = False
        self._cycles = 0

    def begin(self) -> None:
        """Begin a cycle."""
        self._cycles = self._cycles + 1 if self._differ else 0
        self.doubled = self.doubled or self._cycles >= _CERTAIN
        self.complete = self._differ = False

    def add(self, data: bytes) -> None:
        """Process an answer."""
        if self.complete and data != self._data:
            self._differ = True
        self.complete, self._data = True, data
