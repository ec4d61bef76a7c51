"""What a run leaves behind beside its record: where its robots were, and the pictures that they reported.

Plain files in ``results/RUN`` beside ``missions.db``: ``track-ROBOT.csv`` (Unix s, then x, y, z in metres, in
the site's frame where the robot is placed in it, else in its own world) and ``ROBOT-TIME-N.FORMAT``. They are
written by a thread of their own; a file that cannot be written is told, and no run waits for it.

=====================  ==============================================================================
bound                  what happens beyond it
=====================  ==============================================================================
``POINTS`` of a track  it goes on with half as many points a second, again and again
``PICTURES`` of a run  the rest is not kept
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
EVERY = 1.0  # s between two points of a track, at the least
WRITTEN_EVERY = 10  # points
POINTS = 1800  # of a track, after which only every second moment counts
PICTURES = 100  # of a run
RUNS = 50
BYTES = 512 << 20  # of all runs together
FORMATS = frozenset({"jpeg", "png", "webp"})


class Result(msgspec.Struct, frozen=True, omit_defaults=True):
    """One thing that a run left behind: a file on its edge's disk, and how many points a track has."""

    kind: Literal["track", "picture"]
    robot: str
    file: str
    bytes: int
    points: int = 0


class Results:
    """The results of an edge's runs, in a folder. ``now`` in Unix seconds comes with each call."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / RESULTS
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="fleet-results")
        self._tracks: dict[tuple[str, str], _Track] = {}
        self._pictures: dict[str, int] = {}

    def at(self, run: str, robot: str, position: Vector3 | None, now: float) -> None:
        """Note where a robot of a run is; None while that is unknown."""
        track = self._tracks.setdefault((run, robot), _Track())
        if position is None or not track.takes(now):
            return
        track.waiting.append(f"{now:.1f},{position.x:.2f},{position.y:.2f},{position.z:.2f}\n")
        if len(track.waiting) >= WRITTEN_EVERY:
            self._write_track(run, robot, track)

    def picture(self, run: str, robot: str, image: bytes, form: str, now: float) -> None:
        """Keep a picture that a robot of a run reported."""
        number = self._pictures.get(run, 0) + 1
        if number > PICTURES or form not in FORMATS:
            return
        self._pictures[run] = number
        self._do(partial(self._put, run, f"{robot}-{now:.3f}-{number}.{form}", image, "xb"))

    def end(self, run: str) -> None:
        """Write what waits of a run that has ended, and delete the oldest results."""
        for found, robot in list(self._tracks):
            if found == run:
                self._write_track(run, robot, self._tracks.pop((run, robot)))
        self._pictures.pop(run, None)
        self._do(self._prune)

    def of(self, run: str, told: Callable[[list[Result]], None]) -> None:
        """Give ``told``, on the results' thread, what a run has left behind so far."""
        self._do(lambda: told(list(self._listed(run))))

    def close(self) -> None:
        """Write what waits."""
        for run in {run for run, _ in self._tracks}:
            self.end(run)
        self._thread.shutdown()

    def _write_track(self, run: str, robot: str, track: _Track) -> None:
        """Write the points that wait."""
        lines, track.waiting = "".join(track.waiting).encode(), []
        if lines:
            self._do(partial(self._put, run, f"track-{robot}.csv", lines, "ab"))

    def _do(self, work: Callable[[], None]) -> None:
        """Do some work on the thread; what fails is told in the log."""

        def guarded() -> None:
            try:
                work()
            except OSError as error:
                log.warning("results of missions cannot be kept: %s", error)

        with contextlib.suppress(RuntimeError):  # the edge ends: the next start prunes what is left
            self._thread.submit(guarded)

    def _put(self, run: str, name: str, content: bytes, mode: Literal["ab", "xb"]) -> None:
        """Write to a file of a run."""
        folder = self._folder / run
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with (folder / name).open(mode) as file:
            file.write(content)

    def _listed(self, run: str) -> Iterable[Result]:
        """Yield what a run has left behind."""
        folder = self._folder / run
        for path in sorted(folder.iterdir()) if folder.is_dir() else ():
            size = path.stat().st_size
            if path.suffix == ".csv":
                with path.open("rb") as file:
                    points = sum(1 for _ in file)
                yield Result("track", path.stem.removeprefix("track-"), str(path), size, points)
            else:
                yield Result("picture", path.name.rsplit("-", 2)[0], str(path), size)

    def _prune(self) -> None:
        """Delete the results of the oldest runs, beyond those that are kept."""
        if not self._folder.is_dir():
            return
        total = 0
        newest = sorted(self._folder.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for number, folder in enumerate(newest):
            total += sum(path.stat().st_size for path in folder.iterdir())
            if number >= RUNS or (number and total > BYTES):
                shutil.rmtree(folder)


class _Track:
    """One robot's track on its way to the disk."""

    def __init__(self) -> None:
        self.waiting: list[str] = []
        self._taken = 0
        self._next = 0.0

    def takes(self, now: float) -> bool:
        """Return whether a point of this moment is one of the track."""
        if now < self._next:
            return False
        self._next = now + EVERY * 2 ** (self._taken // POINTS)
        self._taken += 1
        return True
