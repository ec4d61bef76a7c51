"""Plays a recording: each message at its time, at any speed."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from fleet.bus.settings import runtime_dir
from fleet.clock import Clock
from fleet.errors import StateError
from fleet.record.reading import ReadMessage, read_recording
from fleet.replay.played_edge import PlayedEdge

FOLDER = "replay"
"""The folder of the sockets of replayed recordings, below that of the running edges."""
FLUSH = 0.02  # s between flushes of reports; each publishes only the newest of a state channel


def replay_directory() -> Path:
    """Return the private folder of the sockets of recordings; no command uses it by default."""
    return runtime_dir({"FLEET_RUNTIME_DIR": str(runtime_dir() / FOLDER)})


class PlayedWindow(msgspec.Struct, frozen=True):
    """A part of a recording: seconds from its start, and its length; played ``speed`` times as fast."""

    start: float = 0.0
    length: float = math.inf
    speed: float = 1.0


async def play(
    path: Path,
    window: PlayedWindow,
    directory: Path,
    ended: asyncio.Event,
    clock: Clock,
    *,
    on_edge: Callable[[PlayedEdge], None] = lambda _edge: None,
) -> int:
    """Play a recording until its end, or ``ended``; return the number of messages.

    Each edge in it has a separate bus below ``directory``; ``on_edge`` is called for each when it is ready.
    Raises StateError for a file with nothing to play, BusError if it is being played already.
    """
    edges: dict[str, PlayedEdge] = {}
    began, count = clock.monotonic(), 0
    with contextlib.ExitStack() as stack:
        flushed = began
        for after, message in _timed(path, window):
            if message.edge not in edges:
                edges[message.edge] = PlayedEdge(message.edge, directory, clock)
                stack.callback(edges[message.edge].close)
                on_edge(edges[message.edge])
            left = began + after / window.speed - clock.monotonic()
            if left > 0 or clock.monotonic() - flushed > FLUSH:
                flushed = clock.monotonic()
                for edge in edges.values():
                    edge.flush()
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(max(left, 0.0)):
                        await ended.wait()
            if ended.is_set():
                break
            edges[message.edge].play(message)
            count += 1
        for edge in edges.values():
            edge.flush()
    if not count:
        raise StateError(f"{path} has nothing in that window")
    return count


def _timed(path: Path, window: PlayedWindow) -> Iterator[tuple[float, ReadMessage]]:
    """Yield the messages of a window, each with its offset in seconds.

    Events before the window, and the last states before it, are played at its start.
    """
    first: float | None = None
    before: dict[str | float, ReadMessage] = {}
    for message in read_recording(path):
        if not message.edge:
            continue
        first = message.received if first is None else first
        after = message.received - first - window.start
        if after < 0:
            is_event = message.schema == "fleet.Record"
            before[message.received if is_event else message.topic] = message
            continue
        if after >= window.length:
            break
        yield from ((0.0, earlier) for earlier in before.values())
        before = {}
        yield after, message
