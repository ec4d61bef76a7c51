"""The places of all runs of an edge: occupied before a run begins, released at its end.

After a restart, runs get back their occupied places before any other run can request them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from fleet.clock import Clock
from fleet.errors import Refused
from fleet.missions.program import Program
from fleet.missions.run import Run
from fleet.missions.state import Phase, PlaceOccupied, RunHead
from fleet.missions.store import StoredRun
from fleet.model.occupancy import Claim, ClaimVerdict, Occupancy, SettledClaim
from fleet.model.place import Place


class RunPlaces:
    """Occupancy of places by runs. ``run_of`` returns a run in progress by its id, or None."""

    def __init__(
        self, places: Mapping[str, Place], run_of: Callable[[str], Run | None], clock: Clock
    ) -> None:
        self.configure(places)
        self._run_of = run_of
        self._clock = clock
        self._missions: dict[str, str] = {}

    def configure(self, places: Mapping[str, Place]) -> None:
        """Replace the places, all of them free; only while no run is in progress."""
        self._capacities = {name: place.capacity for name, place in places.items()}
        self._occupancy = Occupancy(self._capacities)

    def require(self, program: Program) -> None:
        """Raise Refused for places that no run could ever occupy."""
        trouble = self._occupancy.trouble(_wanted(program))
        if trouble:
            raise Refused(f"occupies: {trouble}")

    def is_full(self, place: str) -> bool:
        """Return True if a run that requests a place now would have to wait."""
        return self._occupancy.is_full(place)

    def occupy(self, run: Run) -> None:
        """Occupy the places of a run or queue it for them; inform it and the runs behind it."""
        self._missions[run.id] = run.about.mission
        claim = self._occupancy.claim_of(run.id)
        if claim is not None and claim.complete:
            run.handle(PlaceOccupied())
        elif claim is None:
            self._request(run.id, run.engine.program, run.engine.head.until - run.now)
        self._notify_waiting()

    def release_places(self, run: Run) -> None:
        """Release the places of a run, and inform the runs that get them."""
        self._settle(self._occupancy.release_places(run.id, now=self._clock.monotonic()))
        self._missions.pop(run.id, None)
        self._notify_waiting()

    def expire(self) -> None:
        """End the waits that are past their limit; called periodically."""
        settled = self._occupancy.settle(now=self._clock.monotonic())
        if settled:
            self._settle(settled)
            self._notify_waiting()

    def restore_runs(self, runs: Iterable[StoredRun]) -> None:
        """Restore the occupancy of the runs of an earlier process; waiting runs are queued again."""
        found = sorted(runs, key=lambda kept: kept.about.started)
        self._missions = {kept.about.run: kept.about.mission for kept in found}
        held = [
            Claim(kept.about.run, wanted, math.inf, len(wanted))
            for kept in found
            if not _waits(kept.head) and (wanted := tuple(sorted(_wanted(kept.program).items())))
        ]
        self._occupancy = Occupancy(self._capacities, held)
        for kept in found:
            if _waits(kept.head):
                away = max(0.0, self._clock.time() - kept.stamp)
                self._request(kept.about.run, kept.program, kept.head.until - kept.elapsed - away)

    def _request(self, run: str, program: Program, within: float) -> None:
        """Request the places of a run."""
        now = self._clock.monotonic()
        try:
            self._settle(self._occupancy.request(run, _wanted(program), now=now, within=within))
        except ValueError as error:  # fleet.yaml has changed since its start
            self._notify(run, PlaceOccupied(late=f"occupies: {error}"))

    def _settle(self, settled: Iterable[SettledClaim]) -> None:
        """Inform runs whose wait has ended."""
        for each in settled:
            if each.verdict is ClaimVerdict.GRANTED:
                self._notify(each.holder, PlaceOccupied())
            else:
                late = f"{each.place} did not become free in time: {self._names(each.held_by)} it"
                self._notify(each.holder, PlaceOccupied(late=late))

    def _notify_waiting(self) -> None:
        """Inform waiting runs of the place and its holder, if that has changed."""
        for claim in self._occupancy.claims:
            if claim.next is None:
                continue
            place = claim.next[0]
            words = f"{place}, which {self._names(self._occupancy.held(place))}"
            run = self._run_of(claim.holder)
            if run is not None and run.engine.head.waits_for != words:
                run.handle(PlaceOccupied(words))

    def _names(self, holders: Iterable[str]) -> str:
        """Describe the holders of a place."""
        named = [f"run {run} of {self._missions.get(run, 'a mission')}" for run in holders]
        return f"{' and '.join(named) or 'another run'} has"

    def _notify(self, run: str, event: PlaceOccupied) -> None:
        """Inform a run; one that is not in progress yet requests its places again later."""
        found = self._run_of(run)
        if found is not None:
            found.handle(event)


def _wanted(program: Program) -> dict[str, int]:
    """Return the places of a mission: one unit of each."""
    return dict.fromkeys(program.occupies, 1)


def _waits(head: RunHead) -> bool:
    """Return True if a run has not got its places yet."""
    return Phase.OCCUPYING in (head.phase, head.paused_from if head.phase is Phase.PAUSED else head.phase)
