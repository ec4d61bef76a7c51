"""Rows on disk that are no longer needed: to be deleted, or being deleted."""

from __future__ import annotations


class PendingDeletions:
    """Sequence numbers of messages. Until a deletion is committed, readers of the disk still see the rows."""

    def __init__(self) -> None:
        self._next: set[int] = set()
        self._deleting: set[int] = set()

    def __len__(self) -> int:
        """Return the number of rows to delete next."""
        return len(self._next)

    def __contains__(self, seq: int) -> bool:
        return seq in self._next or seq in self._deleting

    def add(self, seq: int) -> None:
        """Request the deletion of a row, whether it is on disk or still being written."""
        self._next.add(seq)

    def take(self) -> set[int]:
        """Return the rows to delete now; they stay known until ``deleted`` or ``requeue``."""
        self._deleting, self._next = self._next, set()
        return self._deleting

    def deleted(self) -> None:
        """Forget the rows whose deletion is committed."""
        self._deleting = set()

    def requeue(self) -> None:
        """Take back the rows whose deletion failed."""
        self._next |= self._deleting
        self._deleting = set()

    def clear(self) -> None:
        """Forget all rows, after the loss of the file."""
        self._next, self._deleting = set(), set()
