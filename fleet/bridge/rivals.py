"""Other edges that serve one of our twins, as the cloud shows them: the later one gives way."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fleet.clock import Clock
from fleet.wire.claims import Heartbeat

WITHIN = 12.0  # s in which two heartbeats of an edge must come to be believed; it sends one every 5 s
GONE_AFTER = 16.0  # s without a heartbeat after which the other edge has let go


class _Seen(msgspec.Struct):
    """The last heartbeat of another edge for one twin, and when it came (monotonic)."""

    beat: Heartbeat
    at: float


class Rivals:
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
        self._seen: dict[str, _Seen] = {}
        self._holders: dict[str, str] = {}

    def heard(self, twin: str, beat: Heartbeat) -> None:
        """Take the heartbeat of an edge for one of our twins."""
        if beat.edge in self._ignored or beat.session == self._session:
            return
        now = self._clock.monotonic()
        own = Heartbeat(self._edge, self._session, now - self._began)
        if not beat.comes_before(own):
            return
        last = self._seen.get(twin)
        again = last is not None and last.beat.edge == beat.edge and now - last.at <= WITHIN
        self._seen[twin] = _Seen(beat, now)
        if again:
            self._hold(twin, beat.edge)

    def look(self) -> None:
        """Take back the twins whose other edge has gone silent; now and then."""
        now = self._clock.monotonic()
        for twin, seen in list(self._seen.items()):
            if now - seen.at > GONE_AFTER:
                del self._seen[twin]
                self._hold(twin, "")

    def _hold(self, twin: str, holder: str) -> None:
        """Tell of a change, once."""
        if self._holders.get(twin, "") != holder:
            self._holders[twin] = holder
            self._changed(twin, holder)
