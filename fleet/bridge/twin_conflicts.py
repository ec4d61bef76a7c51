"""Other edges that serve one of our twins, seen by their heartbeats in the cloud: the later edge yields."""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.wire.edge_heartbeat import EdgeHeartbeat

WITHIN = 12.0  # s within which two heartbeats of an edge must arrive to count; an edge sends one every 5 s
MOST = 10_000  # claims remembered; any client in the cloud can create more
GONE_AFTER = 16.0  # s without a heartbeat after which the other edge has given the twin up


class TwinConflictMonitor:
    """Monitors the heartbeats of other edges on our twins.

    ``changed`` is called with twin and holder; the holder is empty when no other edge precedes us. Heartbeats
    of ``ignored`` edges claim nothing.
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
        self._seen: dict[tuple[str, str], float] = {}  # time of the last heartbeat, by (twin, edge)
        self._holders: dict[str, str] = {}

    def handle_heartbeat(self, twin: str, beat: EdgeHeartbeat) -> None:
        """Handle the heartbeat of an edge on one of our twins."""
        if beat.edge in self._ignored or beat.session == self._session:
            return
        now = self._clock.monotonic()
        own = EdgeHeartbeat(self._edge, self._session, now - self._began)
        if not beat.is_older_than(own):
            return
        claim = (twin, beat.edge)
        last = self._seen.get(claim, float("-inf"))
        if claim in self._seen or len(self._seen) < MOST:
            self._seen[claim] = now
        if now - last <= WITHIN:
            self._hold(twin, beat.edge)

    def check(self) -> None:
        """Take back the twins whose other edge has gone silent; call it periodically."""
        now = self._clock.monotonic()
        for (twin, edge), at in list(self._seen.items()):
            if now - at > GONE_AFTER:
                del self._seen[(twin, edge)]
                if self._holders.get(twin) == edge:
                    self._hold(twin, "")

    def _hold(self, twin: str, holder: str) -> None:
        """Report a change of holder, once."""
        if self._holders.get(twin, "") != holder:
            self._holders[twin] = holder
            self._changed(twin, holder)
