"""Occupancy of places: exclusive up to their capacity, with bounded waits.

Pure: the time is an argument (monotonic seconds). A holder requests all its places at once and returns all of
them at once. The places are taken one by one in the order of their names, which is the same for all holders;
so waits never form a cycle, and there is no deadlock. The requests for one place are served in the order of
arrival.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping

import msgspec


class Claim(msgspec.Struct):
    """Request of one holder; ``wanted``: places and the number of units of each, in order of name.

    The holder has the first ``taken`` of them. ``until``: end of its wait (monotonic s).
    """

    holder: str
    wanted: tuple[tuple[str, int], ...]
    until: float
    taken: int = 0

    @property
    def complete(self) -> bool:
        """True when the holder has all its places."""
        return self.taken == len(self.wanted)

    @property
    def next(self) -> tuple[str, int] | None:
        """The place that the holder waits for, and its number of units; None when the claim is complete."""
        return None if self.complete else self.wanted[self.taken]


class ClaimVerdict(enum.StrEnum):
    """Result of a claim."""

    GRANTED = "granted"
    LATE = "late"


class SettledClaim(msgspec.Struct, frozen=True):
    """A claim whose wait is over; of a late one, ``place`` was missing, and ``held_by`` are its holders."""

    holder: str
    verdict: ClaimVerdict
    place: str = ""
    held_by: tuple[str, ...] = ()


class Occupancy:
    """The places of an edge and their holders; ``claims`` is the whole state, the oldest first.

    It can be rebuilt from the claims after a restart.
    """

    def __init__(self, capacities: Mapping[str, int], claims: Iterable[Claim] = ()) -> None:
        self._capacities = dict(capacities)
        self.claims = list(claims)

    def trouble(self, wanted: Mapping[str, int]) -> str:
        """Return why no holder can ever have these places, empty if it is possible."""
        for place, number in sorted(wanted.items()):
            capacity = self._capacities.get(place)
            if capacity is None:
                return f"there is no place {place!r}"
            if not 1 <= number <= capacity:
                return f"{place} has room for {capacity}, not for {number}"
        return ""

    def request(
        self, holder: str, wanted: Mapping[str, int], *, now: float, within: float
    ) -> list[SettledClaim]:
        """Request places for a holder that waits at most ``within`` seconds; return the claims settled by it.

        Raises ValueError for places that no holder can have, and for a holder with a claim.
        """
        trouble = self.trouble(wanted)
        if any(claim.holder == holder for claim in self.claims):
            trouble = f"{holder} has asked already; it must give back first"
        if trouble:
            raise ValueError(trouble)
        claim = Claim(holder, tuple(sorted(wanted.items())), now + within)
        self.claims.append(claim)
        return self._settle(now, new=claim)

    def release_places(self, holder: str, *, now: float) -> list[SettledClaim]:
        """Return all places of a holder, or end its wait; return the claims settled by it.

        A holder without a claim is ignored.
        """
        self.claims = [claim for claim in self.claims if claim.holder != holder]
        return self._settle(now)

    def settle(self, *, now: float) -> list[SettledClaim]:
        """Return the claims settled by now: waits that have ended, and grants that follow from these."""
        return self._settle(now)

    def next_end(self) -> float | None:
        """Return when the next wait ends (monotonic s), None when no holder waits."""
        return min((claim.until for claim in self.claims if not claim.complete), default=None)

    def claim_of(self, holder: str) -> Claim | None:
        """Return the claim of a holder, None if it has none."""
        return next((claim for claim in self.claims if claim.holder == holder), None)

    def is_full(self, place: str) -> bool:
        """Return whether a new request for one unit of a place would have to wait."""
        wanted = (number for claim in self.claims for name, number in claim.wanted if name == place)
        return sum(wanted) >= self._capacities.get(place, 0)

    def held(self, place: str) -> dict[str, int]:
        """Return the holders of a place with their numbers of units."""
        return {
            claim.holder: number
            for claim in self.claims
            for name, number in claim.wanted[: claim.taken]
            if name == place
        }

    def _settle(self, now: float, new: Claim | None = None) -> list[SettledClaim]:
        """Expire late claims and grant free places, until nothing changes; return the settled claims."""
        settled: list[SettledClaim] = []
        waiting = [claim for claim in self.claims if not claim.complete or claim is new]
        self._grant_free()
        while late := [claim for claim in self.claims if not claim.complete and claim.until <= now]:
            settled += [self._late(claim) for claim in late]
            self.claims = [claim for claim in self.claims if claim not in late]
            self._grant_free()
        granted = [claim for claim in self.claims if claim.complete and claim in waiting]
        return settled + [SettledClaim(claim.holder, ClaimVerdict.GRANTED) for claim in granted]

    def _grant_free(self) -> None:
        """Grant free places, the oldest claim first.

        One pass is enough: a grant frees nothing, so what an older claim could not get, it cannot get later.
        """
        free = dict(self._capacities)
        for claim in self.claims:
            for place, number in claim.wanted[: claim.taken]:
                free[place] = free.get(place, 0) - number
        awaited: set[str] = set()
        for claim in self.claims:
            while (wanted := claim.next) and wanted[0] not in awaited and free.get(wanted[0], 0) >= wanted[1]:
                free[wanted[0]] -= wanted[1]
                claim.taken += 1
            if claim.next is not None:
                awaited.add(claim.next[0])

    def _late(self, claim: Claim) -> SettledClaim:
        """Return the result of a late claim, with the holders of the place that it waited for."""
        place = claim.wanted[claim.taken][0]
        return SettledClaim(claim.holder, ClaimVerdict.LATE, place, tuple(self.held(place)))
