"""The rows on disk that nobody waits for any more: to be deleted, or being deleted."""

from __future__ import annotations


class PendingDeletions:
    """Numbers of messages. Until a deletion is on disk, what reads the disk still meets their rows."""

    def __init__(self) -> None:
        self._next: set[int] = set()
        self._deleting: set[int] = set()

    def __len__(self) -> int:
        """Return how many are to be deleted next."""
        return len(self._next)

    def __contains__(self, seq: int) -> bool:
        return seq in self._next or seq in self._deleting

    def add(self, seq: int) -> None:
        """Have a row deleted, whether it is on disk already or on its way there."""
        self._next.add(seq)

    def take(self) -> set[int]:
        """Return what is to be deleted now; they stay known until ``deleted`` or ``put_back``."""
        self._deleting, self._next = self._next, set()
        return self._deleting

    def deleted(self) -> None:
        """Forget what is not on disk any more."""
        self._deleting = set()

    def put_back(self) -> None:
        """Take back what could not be deleted."""
        self._next |= self._deleting
        self._deleting = set()

    def clear(self) -> None:
        """Forget all: the disk holds nothing of it."""
        self._next, self._deleting = set(), set()
