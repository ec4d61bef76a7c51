"""A process of schedules that is killed at any instant: no firing is lost, none is started twice."""

import itertools
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from fleet.schedules.store import DUE, SKIPPED, STARTED, FiringStore
from tests.tools.waiting import wait_until

KILLS = int(os.environ.get("FLEET_SOAK_KILLS", "5"))
SCRIPT = Path(__file__).with_name("scheduled.py")


def test_firings_are_neither_lost_nor_doubled_by_kills_at_random_instants(tmp_path):
    began, rng = time.time(), random.Random(7)
    runs = tmp_path / "runs"

    def started():
        return runs.read_text().splitlines() if runs.exists() else []

    for kill in range(KILLS + 1):
        command = [sys.executable, str(SCRIPT), str(tmp_path), str(began)]
        with subprocess.Popen(command) as process:
            before = len(started())
            wait_until("it starts something", lambda before=before: len(started()) > before + 2)
            time.sleep(rng.random() * 0.15)
            process.send_signal(signal.SIGKILL if kill < KILLS else signal.SIGINT)
    keys = started()
    assert len(keys) == len(set(keys)), "a firing was started twice"
    store = FiringStore(tmp_path)
    for name, every in (("often", 10.0), ("seldom", 70.0)):
        firings = list(reversed(store.last(name, 1000)))
        known = {firing.key for firing in firings}
        assert {key for key in keys if key.startswith(f"{name}@")} <= known, "one was started unrecorded"
        ends = {firing.state for firing in firings[:-1]}
        assert ends <= {STARTED, SKIPPED}, "one before the last has no end"
        assert all(
            (firing.state == STARTED) == (firing.key in keys) for firing in firings if firing.state != DUE
        )
        assert all(firing.reason for firing in firings if firing.state == SKIPPED)
        gaps = [later.due - one.due for one, later in itertools.pairwise(firings)]
        if name == "often":  # an hour late is not too late for any, so each has a row of its own
            assert gaps == [every] * len(gaps)
    store.close()
