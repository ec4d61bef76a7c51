"""The store of roll-outs, as an edge and whoever rolls out see it (``fleet.rollout.nats_store``)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from fleet.errors import FleetError
from fleet.rollout.bundle import HEAD, LARGEST
from fleet.rollout.messages import Desired, Observed, Rollout

PART = 256 << 10  # bytes of a part of a bundle
MOST_PARTS = -(-(LARGEST + len(HEAD)) // PART)


class StoreError(FleetError):
    """The store of roll-outs does not answer, or refuses."""


class EdgeStore(Protocol):
    """What an edge reads and writes."""

    async def desired(self) -> Desired | None:
        """Return what the edge shall run, None where nothing is said; raises StoreError, StateError."""

    async def bundle(self, address: str, parts: int) -> bytes:
        """Return the bytes of a bundle; raises StoreError, BundleError for one that is too large."""

    async def report(self, observed: Observed) -> None:
        """Write what the edge reports; raises StoreError."""


class FleetStore(Protocol):
    """What whoever rolls out reads and writes; everything raises StoreError."""

    async def put_bundle(self, address: str, data: bytes) -> int:
        """Store a bundle, and return in how many parts."""

    async def desire(self, edge: str, desired: Desired) -> None:
        """Write what an edge shall run."""

    async def observed(self, edges: Iterable[str]) -> dict[str, Observed]:
        """Return what these edges report; one whose report cannot be read is as silent."""

    async def rollout(self) -> tuple[Rollout | None, int]:
        """Return the last roll-out, and the revision that its change needs; raises StateError too."""

    async def keep(self, rollout: Rollout, revision: int) -> int:
        """Write a roll-out in the place of a revision, and return its own."""


def parts_of(data: bytes) -> list[bytes]:
    """Return the parts in which the bytes of a bundle are stored."""
    return [data[at : at + PART] for at in range(0, len(data), PART)]
