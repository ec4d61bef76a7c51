"""Store of the lease of a pair: the interface, and the address of the service."""

from __future__ import annotations

from typing import Protocol

import msgspec

from fleet.standby.lease import LeaseEntry

ANSWER_WITHIN = 0.7  # s for one request: the lease must be renewed several times in its length


class ServiceSettings(msgspec.Struct, frozen=True):
    """Address and account of the lease service."""

    servers: tuple[str, ...]
    user: str | None = None
    password: str | None = None
    ca_file: str | None = None


class LeaseStore(Protocol):
    """Interface of a store of the lease."""

    async def read(self) -> tuple[LeaseEntry | None, int]:
        """Return the entry and its revision; without an entry None and the revision of its deletion, or 0.

        Raises StateError if the store does not answer, or if its content is no lease.
        """

    async def write(self, entry: LeaseEntry, revision: int) -> int | None:
        """Write the entry in place of this revision; None: the revision has changed. Raises StateError."""

    async def close(self) -> None:
        """Disconnect from the store."""
