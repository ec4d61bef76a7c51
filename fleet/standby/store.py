"""What keeps the lease of a pair: the interface, and where the service is."""

from __future__ import annotations

from typing import Protocol

import msgspec

from fleet.standby.lease import Entry

ANSWER_WITHIN = 0.7  # s for one request: the lease must be renewed several times in its length


class ServiceSettings(msgspec.Struct, frozen=True):
    """Where the lease service is, and how it is reached."""

    servers: tuple[str, ...]
    user: str | None = None
    password: str | None = None
    ca_file: str | None = None


class LeaseStore(Protocol):
    """What keeps the lease."""

    async def read(self) -> tuple[Entry | None, int]:
        """Return the entry and its revision; None and the revision of its deletion, or 0, without one.

        Raises StateError when the store does not answer, or what it has is no lease.
        """

    async def write(self, entry: Entry, revision: int) -> int | None:
        """Write the entry in the place of this revision; None: it has another one. Raises StateError."""

    async def close(self) -> None:
        """Leave the store."""
