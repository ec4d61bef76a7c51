"""Firings of schedules and their runs, in a process that is killed: none is lost, none is started twice."""

import contextlib
import itertools
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from fleet.missions.store import MISSIONS
from fleet.schedules.store import DUE, SKIPPED, STARTED, FiringStore
from tests.tools.waiting import wait_until

KILLS = int(os.environ.get("FLEET_SOAK_KILLS", "5"))
SCRIPT = Path(__file__).with_name("started.py")


class Edge:
    """A folder in which processes start missions by a schedule, one after the other."""

    def __init__(self, folder):
        self.folder, self._began = folder, time.time()
        self.fires = {"every": 10.0}

    @contextlib.contextmanager
    def process(self, kill=""):
        """Run a process; it is killed at the end, if it did not kill itself."""
        fires = json.dumps(self.fires)
        command = [sys.executable, str(SCRIPT), str(self.folder), str(self._began), fires, kill]
        with subprocess.Popen(command) as process:
            try:
                yield process
            finally:
                process.send_signal(signal.SIGKILL)

    def firings(self):
        """Return the firings, the oldest first."""
        with contextlib.closing(FiringStore(self.folder)) as store:
            return list(reversed(store.last("round", 1000)))

    def runs(self):
        """Return the runs that are on disk."""
        with contextlib.closing(sqlite3.connect(self.folder / MISSIONS)) as database:
            return [run for (run,) in database.execute("SELECT id FROM run")]

    def ended(self, run):
        """Return whether a run has ended."""
        with contextlib.closing(sqlite3.connect(self.folder / MISSIONS)) as database:
            return database.execute("SELECT ended FROM run WHERE id = ?", (run,)).fetchone() == (1,)

    def walked(self):
        """Return what robots were told, by its identity: run, step, robot, attempt."""
        file = self.folder / "walked"
        return file.read_text().splitlines() if file.exists() else []


@pytest.fixture
def edge(tmp_path):
    return Edge(tmp_path)


@pytest.mark.parametrize(("kill", "runs"), [("before", 0), ("after", 1)])
def test_a_kill_between_recording_and_starting_neither_loses_nor_doubles(edge, kill, runs):
    edge.fires = {"once": datetime.fromtimestamp(time.time() + 200, UTC).isoformat()}
    with edge.process(kill) as process:
        assert process.wait(60) == -signal.SIGKILL
    (firing,), before = edge.firings(), edge.runs()
    assert (firing.state, len(before)) == (DUE, runs)
    with edge.process():
        wait_until("it is started", lambda: edge.firings()[0].state == STARTED)
        (run,) = edge.runs()
        wait_until("the run has ended", lambda: edge.ended(run))
    (started,) = edge.firings()
    assert (started.key, started.run) == (firing.key, run)
    assert before in ([], [run]), "it was started as another run"
    if kill == "before":
        assert sorted(identity.split("/")[2] for identity in edge.walked()) == ["max", "rex"]
    _is_sound(edge)


def test_firings_and_runs_are_one_to_one_after_kills_at_random_instants(edge):
    rng = random.Random(7)
    for _ in range(KILLS):
        with edge.process():
            before = len(edge.walked())
            wait_until("missions are started", lambda before=before: len(edge.walked()) > before + 4)
            time.sleep(rng.random() * 0.15)
    _is_sound(edge)


def _is_sound(edge):
    """Check that each run is one firing's, and that no robot was told anything twice."""
    firings, runs, walked = edge.firings(), edge.runs(), edge.walked()
    started = [firing.run for firing in firings if firing.state == STARTED]
    assert len(started) == len(set(started)), "two firings have one run"
    assert set(started) <= set(runs), "a firing has no run"
    open_ones = [firing for firing in firings if firing.state == DUE]
    assert len(set(runs) - set(started)) <= len(open_ones), "a run has no firing"
    assert all(firing.reason for firing in firings if firing.state == SKIPPED)
    assert len(walked) == len(set(walked)), "a robot was told something twice"
    assert {identity.split("/")[0] for identity in walked} <= set(runs), "a robot moved for no recorded run"
    every = edge.fires.get("every")
    gaps = [later.due - one.due for one, later in itertools.pairwise(firings)]
    assert gaps == [every] * len(gaps), "a firing is missing"
