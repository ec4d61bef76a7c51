"""Series of the recorded numbers of one robot, thinned so that each peak stays; pure but for the reading.

The work is limited: in the length of the window, in the numbers and their points, and in processor time.
When the time is used up, the series have gaps that are spread over the window, and ``share`` says so.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from fleet.console.numbers import source_in
from fleet.console.recorded_numbers import recorded_numbers, recorded_source
from fleet.console.requests import PageSeriesRequest
from fleet.errors import Refused

if TYPE_CHECKING:
    from fleet.record.chunks import RecordedTopic  # its packages are an extra
    from fleet.record.reading import ReadMessage
    from fleet.record.window import Window

MOST_WINDOW = 600.0  # s
MOST_SPENT = 0.5  # s of processor time for the messages of a window
MOST_OFFERED = 1000  # names
SAMPLES = 30  # messages of each topic that are searched for names, when no series needs the others

SeriesPoint = tuple[float, float]
"""Unix s, and the value."""


class Downsampled:
    """The values of a number as at most ``most`` points: the least and greatest of each part of a window."""

    def __init__(self, since: float, until: float, most: int) -> None:
        self._since = since
        self._count = most // 2
        self._length = (until - since) / self._count
        self._parts: dict[int, tuple[SeriesPoint, SeriesPoint]] = {}

    def add(self, at: float, value: float) -> None:
        """Add a value of the window, in any order; of equal values the first in time counts."""
        part = min(self._count - 1, max(0, int((at - self._since) / self._length)))
        point = (at, value)
        least, greatest = self._parts.get(part, (point, point))
        self._parts[part] = (
            min(least, point, key=lambda each: (each[1], each[0])),
            min(greatest, point, key=lambda each: (-each[1], each[0])),
        )

    def points(self) -> list[SeriesPoint]:
        """Return the points, oldest first."""
        return [point for part in sorted(self._parts) for point in sorted(set(self._parts[part]))]


def require_bounds(requested: PageSeriesRequest) -> None:
    """Raise Refused for a robot or window that cannot be."""
    if [bool(part) for part in requested.robot.split("/")] != [True, True]:
        raise Refused(f"{requested.robot!a} is no robot: its name is EDGE/ROBOT")
    if not (math.isfinite(requested.until) and 0 <= requested.since < requested.until < 1e10):
        raise Refused("a window begins before it ends, both in Unix seconds")
    if requested.until - requested.since > MOST_WINDOW:
        raise Refused(f"a window has {MOST_WINDOW / 60:g} min at most")


def read_series(requested: PageSeriesRequest, window: Window, spent: Callable[[], float]) -> dict[str, Any]:
    """Return the series of the wanted numbers, with the names of all; ``spent`` is processor time, s.

    ``share`` is the share of the window that was read, ``problems`` what of it cannot be read.
    """
    found = _FoundNumbers(requested)
    parts, started, count = window.parts, spent(), 0
    for part in parts:
        if spent() - started > MOST_SPENT:
            break
        found.add(window.read(part, found.wants))
        count += 1
    share = count / len(parts) if parts else 1.0
    return {**found.fields(), "share": share, "problems": [*window.all_problems(), *found.problems()]}


class _FoundNumbers:
    """The numbers found in messages."""

    def __init__(self, requested: PageSeriesRequest) -> None:
        self._requested = requested
        self._series = {
            name: Downsampled(requested.since, requested.until, requested.points) for name in requested.names
        }
        self._sources = {source_in(name) for name in requested.names}
        self._names: set[str] = set()
        self._samples: Counter[str] = Counter()
        self._unreadable: Counter[str] = Counter()

    def wants(self, channel: RecordedTopic) -> bool:
        """Return True if more messages of a channel are needed."""
        source = recorded_source(channel.topic, channel.schema)
        return source in self._sources or (bool(source) and self._samples[channel.topic] < SAMPLES)

    def add(self, messages: Iterable[ReadMessage]) -> None:
        """Add the numbers of messages."""
        for message in messages:
            self._samples[message.topic] += 1
            try:
                numbers = recorded_numbers(message)
            except ValueError:
                self._unreadable[message.topic] += 1
                continue
            if len(self._names) < MOST_OFFERED:
                self._names |= numbers.keys()
            for name in self._series.keys() & numbers.keys():
                self._series[name].add(message.received, numbers[name])

    def fields(self) -> dict[str, Any]:
        """Return names and series for a page; each series as its times and its values."""
        points = {name: thinned.points() for name, thinned in self._series.items()}
        values = {
            name: [[round(at, 3) for at, _ in each], [value for _, value in each]]
            for name, each in points.items()
        }
        requested = self._requested
        return {
            "robot": requested.robot,
            "since": requested.since,
            "until": requested.until,
            "names": sorted(self._names)[:MOST_OFFERED],
            "values": values,
        }

    def problems(self) -> list[str]:
        """Return which messages cannot be read."""
        return [f"unreadable messages of {topic}: {count}" for topic, count in self._unreadable.items()]
