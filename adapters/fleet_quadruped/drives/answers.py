"""What one drive has answered in a cycle, and whether there are two drives with its id."""

from __future__ import annotations

_CERTAIN = 5  # cycles in a row with two answers: late and repeated frames do not do that


class Answers:
    """The answers to one id. Two that differ, cycle after cycle, come from two drives.

    ``doubled``: it is certain that two drives have this id; for good.
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

    def take(self, data: bytes) -> None:
        """Take an answer."""
        if self.complete and data != self._data:
            self._differ = True
        self.complete, self._data = True, data
