"""Interfaces of the store of roll-outs for edges and operators; ``nats_store`` implements them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from fleet.errors import FleetError
from fleet.rollout.bundle import HEAD, LARGEST
from fleet.rollout.messages import DesiredState, ObservedState, Rollout

PART = 256 << 10  # bytes of one part of a bundle
MOST_PARTS = -(-(LARGEST + len(HEAD)) // PART)


class StoreError(FleetError):
    """The store of roll-outs does not answer, or refuses a request."""


class EdgeStore(Protocol):
    """Store as one edge uses it."""

    async def desired(self) -> DesiredState | None:
        """Return the desired state of the edge, None if there is none; raises StoreError, StateError."""

    async def bundle(self, address: str, parts: int) -> bytes:
        """Return the bytes of a bundle; raises StoreError, and BundleError if it is too large."""

    async def report(self, observed: ObservedState) -> None:
        """Write the report of the edge; raises StoreError."""


class FleetStore(Protocol):
    """Store as an operator uses it; all methods raise StoreError."""

    async def put_bundle(self, address: str, data: bytes) -> int:
        """Store a bundle and return the number of its parts."""

    async def put_desired(self, edge: str, desired: DesiredState) -> None:
        """Write the desired state of an edge."""

    async def observed(self, edges: Iterable[str]) -> dict[str, ObservedState]:
        """Return the reports of these edges, without missing and unreadable ones."""

    async def rollout(self) -> tuple[Rollout | None, int]:
        """Return the last roll-out and its revision, for ``replace_rollout``; also raises StateError."""

    async def replace_rollout(self, rollout: Rollout, revision: int) -> int:
        """Replace the roll-out of this revision and return the new revision."""


def parts_of(data: bytes) -> list[bytes]:
    """Split the bytes of a bundle into parts for the store."""
    return [data[at : at + PART] for at in range(0, len(data), PART)]
