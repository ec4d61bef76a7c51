"""Who has which places: exclusive up to their capacity, taken in one order, waited for no longer than said.

Pure: the time is an argument (monotonic seconds). A holder asks once for all that it wants and gives all of
it back at once. What it wants is taken place by place, in the order of the names, which is the same for all;
so nobody waits for who waits for him, and there is no deadlock. Of several that wait for one place the one
that asked first is first.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping

import msgspec


class Claim(msgspec.Struct):
    """What one holder wants (``wanted``: places and how many of each, in the one order).

    The first ``taken`` of them it has. ``until``: when it stops waiting (monotonic s).
    """

    holder: str
    wanted: tuple[tuple[str, int], ...]
    until: float
    taken: int = 0

    @property
    def complete(self) -> bool:
        """True when it has all that it wants."""
        return self.taken == len(self.wanted)

    @property
    def next(self) -> tuple[str, int] | None:
        """The place that it waits for, and how many of it; None when it has all."""
        return None if self.complete else self.wanted[self.taken]


class Verdict(enum.StrEnum):
    """What became of a claim."""

    GRANTED = "granted"
    LATE = "late"


class Settled(msgspec.Struct, frozen=True):
    """A claim that waits no longer; of a late one ``place`` was missing, which ``held_by`` had."""

    holder: str
    verdict: Verdict
    place: str = ""
    held_by: tuple[str, ...] = ()


class Occupancy:
    """The places of an edge and who has them; ``claims`` is all its state, the oldest first.

    It may be made anew from them, after a restart.
    """

    def __init__(self, capacities: Mapping[str, int], claims: Iterable[Claim] = ()) -> None:
        self._capacities = dict(capacities)
        self.claims = list(claims)

    def trouble(self, wanted: Mapping[str, int]) -> str:
        """Return why nobody could ever have these places, empty when somebody could."""
        for place, number in sorted(wanted.items()):
            capacity = self._capacities.get(place)
            if capacity is None:
                return f"there is no place {place!r}"
            if not 1 <= number <= capacity:
                return f"{place} has room for {capacity}, not for {number}"
        return ""

    def ask(self, holder: str, wanted: Mapping[str, int], *, now: float, within: float) -> list[Settled]:
        """Take places for a holder, or let it wait for ``within`` seconds; return who waits no longer.

        Raises ValueError for places that nobody could have, and for a holder that has asked already.
        """
        trouble = self.trouble(wanted)
        if any(claim.holder == holder for claim in self.claims):
            trouble = f"{holder} has asked already; it must give back first"
        if trouble:
            raise ValueError(trouble)
        claim = Claim(holder, tuple(sorted(wanted.items())), now + within)
        self.claims.append(claim)
        return self._settle(now, new=claim)

    def give_back(self, holder: str, *, now: float) -> list[Settled]:
        """Give back all that a holder has, or end its wait; return who waits no longer.

        A holder that has nothing gives nothing back.
        """
        self.claims = [claim for claim in self.claims if claim.holder != holder]
        return self._settle(now)

    def look(self, *, now: float) -> list[Settled]:
        """Return who has waited too long by now, and who got what that gave back."""
        return self._settle(now)

    def next_end(self) -> float | None:
        """Return when somebody's wait ends (monotonic s), None when nobody waits."""
        return min((claim.until for claim in self.claims if not claim.complete), default=None)

    def claim_of(self, holder: str) -> Claim | None:
        """Return what a holder has asked for; None for nothing."""
        return next((claim for claim in self.claims if claim.holder == holder), None)

    def is_full(self, place: str) -> bool:
        """Return whether who asks now for a place would have to wait for it."""
        wanted = (number for claim in self.claims for name, number in claim.wanted if name == place)
        return sum(wanted) >= self._capacities.get(place, 0)

    def held(self, place: str) -> dict[str, int]:
        """Return who has a place, and how many of it."""
        return {
            claim.holder: number
            for claim in self.claims
            for name, number in claim.wanted[: claim.taken]
            if name == place
        }

    def _settle(self, now: float, new: Claim | None = None) -> list[Settled]:
        """Let go of who waited too long, then let everyone take what is free; until nothing changes."""
        settled: list[Settled] = []
        waiting = [claim for claim in self.claims if not claim.complete or claim is new]
        self._take()
        while late := [claim for claim in self.claims if not claim.complete and claim.until <= now]:
            settled += [self._late(claim) for claim in late]
            self.claims = [claim for claim in self.claims if claim not in late]
            self._take()
        granted = [claim for claim in self.claims if claim.complete and claim in waiting]
        return settled + [Settled(claim.holder, Verdict.GRANTED) for claim in granted]

    def _take(self) -> None:
        """Let everyone take what is free, the oldest first.

        Once is enough: taking frees nothing, so what an older one could not have it cannot have later.
        """
        free = dict(self._capacities)
        for claim in self.claims:
            for place, number in claim.wanted[: claim.taken]:
                free[place] = free.get(place, 0) - number
        awaited: set[str] = set()
        for claim in self.claims:
            while (wish := claim.next) and wish[0] not in awaited and free.get(wish[0], 0) >= wish[1]:
                free[wish[0]] -= wish[1]
                claim.taken += 1
            if claim.next is not None:
                awaited.add(claim.next[0])

    def _late(self, claim: Claim) -> Settled:
        """Return that a claim waited too long, and for whom."""
        place = claim.wanted[claim.taken][0]
        return Settled(claim.holder, Verdict.LATE, place, tuple(self.held(place)))
