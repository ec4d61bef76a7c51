"""Results of a run besides its record: tracks of its robots, and pictures that they reported.

Plain files in ``results/RUN`` beside ``missions.db``: ``track-ROBOT.csv`` (Unix s, then x, y, z in metres, in
the site's frame if the robot is placed in it, else in its own world frame) and ``ROBOT-TIME-N.FORMAT``. A
thread of its own writes them; a write error is logged, and no run waits for it.

=====================  ==============================================================================
bound                  behaviour beyond it
=====================  ==============================================================================
``POINTS`` of a track  it continues with half as many points per second, repeatedly
``PICTURES`` of a run  further ones are dropped
``RUNS``, ``BYTES``    the results of the oldest runs are deleted
=====================  ==============================================================================
"""

from __future__ import annotations

import contextlib
import logging
import shutil
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Literal

import msgspec

from fleet.model.geometry import Vector3

log = logging.getLogger(__name__)

RESULTS = "results"
EVERY = 1.0  # s between two points of a track, at least
WRITTEN_EVERY = 10  # points
POINTS = 1800  # of a track, after which the interval between points doubles
PICTURES = 100  # of a run
RUNS = 50
BYTES = 512 << 20  # of all runs together
FORMATS = frozenset({"jpeg", "png", "webp"})


class RunFile(msgspec.Struct, frozen=True, omit_defaults=True):
    """One result of a run: a file on its edge's disk; ``points`` is the length of a track."""

    kind: Literal["track", "picture"]
    robot: str
    file: str
    bytes: int
    points: int = 0


class Results:
    """The results of an edge's runs in a folder. Each call passes ``now`` in Unix seconds."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / RESULTS
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="fleet-results")
        self._tracks: dict[tuple[str, str], _WaitingTrack] = {}
        self._pictures: dict[str, int] = {}

    def record_position(self, run: str, robot: str, position: Vector3 | None, now: float) -> None:
        """Record the position of a robot of a run; None if unknown."""
        track = self._tracks.setdefault((run, robot), _WaitingTrack())
        if position is None or not track.admits(now):
            return
        track.waiting.append(f"{now:.1f},{position.x:.2f},{position.y:.2f},{position.z:.2f}\n")
        if len(track.waiting) >= WRITTEN_EVERY:
            self._write_track(run, robot, track)

    def store_picture(self, run: str, robot: str, image: bytes, form: str, now: float) -> None:
        """Store a picture that a robot of a run reported."""
        number = self._pictures.get(run, 0) + 1
        if number > PICTURES or form not in FORMATS:
            return
        self._pictures[run] = number
        self._do(partial(self._put, run, f"{robot}-{now:.3f}-{number}.{form}", image, "xb"))

    def end(self, run: str) -> None:
        """Write the waiting points of a run that has ended, and delete the oldest results."""
        for found, robot in list(self._tracks):
            if found == run:
                self._write_track(run, robot, self._tracks.pop((run, robot)))
        self._pictures.pop(run, None)
        self._do(self._prune)

    def of(self, run: str, callback: Callable[[list[RunFile]], None]) -> None:
        """Pass the results of a run so far to ``callback``, on the thread of the results."""
        self._do(lambda: callback(list(self._listed(run))))

    def close(self) -> None:
        """Write the waiting points and end the thread."""
        for run in {run for run, _ in self._tracks}:
            self.end(run)
        self._thread.shutdown()

    def _write_track(self, run: str, robot: str, track: _WaitingTrack) -> None:
        """Write the waiting points."""
        lines, track.waiting = "".join(track.waiting).encode(), []
        if lines:
            self._do(partial(self._put, run, f"track-{robot}.csv", lines, "ab"))

    def _do(self, work: Callable[[], None]) -> None:
        """Run work on the thread; errors are logged."""

        def guarded() -> None:
            try:
                work()
            except OSError as error:
                log.warning("results of missions cannot be kept: %s", error)

        with contextlib.suppress(RuntimeError):  # the edge is shutting down: the next start prunes the rest
            self._thread.submit(guarded)

    def _put(self, run: str, name: str, content: bytes, mode: Literal["ab", "xb"]) -> None:
        """Write to a file of a run."""
        folder = self._folder / run
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with (folder / name).open(mode) as file:
            file.write(content)

    def _listed(self, run: str) -> Iterable[RunFile]:
        """Yield the results of a run."""
        folder = self._folder / run
        for path in sorted(folder.iterdir()) if folder.is_dir() else ():
            size = path.stat().st_size
            if path.suffix == ".csv":
                with path.open("rb") as file:
                    points = sum(1 for _ in file)
                yield RunFile("track", path.stem.removeprefix("track-"), str(path), size, points)
            else:
                yield RunFile("picture", path.name.rsplit("-", 2)[0], str(path), size)

    def _prune(self) -> None:
        """Delete the results of the oldest runs beyond the limits."""
        if not self._folder.is_dir():
            return
        total = 0
        newest = sorted(self._folder.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for number, folder in enumerate(newest):
            total += sum(path.stat().st_size for path in folder.iterdir())
            if number >= RUNS or (number and total > BYTES):
                shutil.rmtree(folder)


class _WaitingTrack:
    """The waiting points of one robot's track."""

    def __init__(self) -> None:
        self.waiting: list[str] = []
        self._taken = 0
        self._next = 0.0

    def admits(self, now: float) -> bool:
        """Return True if a point at this time belongs to the track."""
        if now < self._next:
            return False
        self._next = now + EVERY * 2 ** (self._taken // POINTS)
        self._taken += 1
        return True
