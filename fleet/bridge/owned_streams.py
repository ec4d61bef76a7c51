"""Video streams of programs on the bus; each lasts until its end or until its reports stop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection

from fleet.clock import Clock
from fleet.errors import WireError
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.streams import CHANNEL, LIFETIME, StreamState, health_of, read_stream
from fleet.wire.topics import parse_data_key

MOST = 16  # streams of one twin


class OwnedStreams:
    """The reported streams of some twins; any thread."""

    def __init__(self, twins: Collection[str], refusals: RateLimitedCounter, clock: Clock) -> None:
        self._streams: dict[str, dict[str, tuple[StreamState, float]]] = {twin: {} for twin in twins}
        self._lock = threading.Lock()
        self._refusals = refusals
        self._clock = clock

    def join(self, twin: str) -> None:
        """Start to track the streams of one more twin."""
        with self._lock:
            self._streams[twin] = {}

    def leave(self, twin: str) -> None:
        """Stop tracking the streams of a twin."""
        with self._lock:
            self._streams.pop(twin, None)

    def listen(self, subscribe: Callable[[str, Callable[[str, bytes], None]], object]) -> None:
        """Subscribe to the stream reports of programs with ``subscribe``."""
        subscribe(f"cw/*/data/{CHANNEL}/*", self.handle_report)

    def handle_report(self, key: str, sample: bytes) -> None:
        """Handle a program's report of one stream; an empty sample ends it. Other twins are ignored."""
        parsed = parse_data_key(key)
        if parsed is None or parsed.sensor is None or parsed.twin not in self._streams:
            return
        try:
            stream = read_stream(sample)
        except WireError as error:
            self._refusals.add("unreadable", "a stream on %s cannot be read: %s", key, error)
            return
        with self._lock:
            if parsed.twin not in self._streams:  # the twin was removed meanwhile
                return
            streams = self._current(parsed.twin)
            streams.pop(parsed.sensor, None)
            if stream is not None and len(streams) < MOST:
                streams[parsed.sensor] = (stream, self._clock.monotonic())
            elif stream is not None:
                self._refusals.add("too many", "%s has more than %d streams", parsed.twin, MOST)

    def of(self, twin: str) -> dict[str, dict[str, object]]:
        """Return ``edge_health.streams`` of a twin."""
        now = self._clock.time()
        with self._lock:
            streams = dict(self._current(twin))
        return {name: health_of(name, stream, now=now) for name, (stream, _) in sorted(streams.items())}

    def _current(self, twin: str) -> dict[str, tuple[StreamState, float]]:
        """Return the streams of a twin, without those whose reports have stopped."""
        since = self._clock.monotonic() - LIFETIME
        streams = self._streams[twin]
        for name in [name for name, (_, at) in streams.items() if at < since]:
            del streams[name]
        return streams
