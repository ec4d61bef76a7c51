"""Other edges that serve one of our twins, as the cloud shows them: the later one gives way."""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.wire.claims import EdgeHeartbeat

WITHIN = 12.0  # s in which two heartbeats of an edge must come to be believed; it sends one every 5 s
MOST = 10_000  # edges that are remembered; anybody in the cloud can invent more
GONE_AFTER = 16.0  # s without a heartbeat after which the other edge has let go


class TwinConflictMonitor:
    """Watches the heartbeats of our twins.

    ``changed`` hears twin and holder, which is empty when nobody has it before us. ``ignored`` holds edges
    whose heartbeat claims nothing.
    """

    def __init__(
        self,
        *,
        edge: str,
        session: str,
        ignored: frozenset[str],
        changed: Callable[[str, str], None],
        clock: Clock,
    ) -> None:
        self._edge = edge
        self._session = session
        self._ignored = ignored
        self._changed = changed
        self._clock = clock
        self._began = clock.monotonic()
        self._seen: dict[tuple[str, str], float] = {}  # when the last heartbeat of (twin, edge) came
        self._holders: dict[str, str] = {}

    def heard(self, twin: str, beat: EdgeHeartbeat) -> None:
        """Take the heartbeat of an edge for one of our twins."""
        if beat.edge in self._ignored or beat.session == self._session:
            return
        now = self._clock.monotonic()
        own = EdgeHeartbeat(self._edge, self._session, now - self._began)
        if not beat.comes_before(own):
            return
        claim = (twin, beat.edge)
        last = self._seen.get(claim, float("-inf"))
        if claim in self._seen or len(self._seen) < MOST:
            self._seen[claim] = now
        if now - last <= WITHIN:
            self._hold(twin, beat.edge)

    def look(self) -> None:
        """Take back the twins whose other edge has gone silent; now and then."""
        now = self._clock.monotonic()
        for (twin, edge), at in list(self._seen.items()):
            if now - at > GONE_AFTER:
                del self._seen[(twin, edge)]
                if self._holders.get(twin) == edge:
                    self._hold(twin, "")

    def _hold(self, twin: str, holder: str) -> None:
        """Tell of a change, once."""
        if self._holders.get(twin, "") != holder:
            self._holders[twin] = holder
            self._changed(twin, holder)
