"""``fleet logs``, the log of edges and workers; and where ``fleet run`` writes it."""

import contextlib
import json
import logging
import os
import pty
import re
import select
import subprocess
import sys
import threading
import time

import pytest

from fleet.host.logs.folders import show_log
from fleet.host.logs.line_format import JsonFormatter
from fleet.host.logs.rotating_file import RotatingLogFile
from tests.tools.waiting import DEADLINE, wait_until

NOW = time.time()


@pytest.fixture
def kept(tmp_path, monkeypatch, runtime):
    """Return what logs lines of an edge's processes, some of them some time ago."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = tmp_path / "state" / "fleet" / "yard-1" / "log"

    def log(message, name="fleet.host", ago=0.0, process="main", **options):
        file = RotatingLogFile(folder / f"{process}.jsonl", JsonFormatter(), **options)
        line = logging.LogRecord(name, logging.WARNING, "x.py", 1, message, (), None)
        line.created = NOW - ago
        file.handle(line)
        file.close()

    log.folder = folder
    return log


def messages(result):
    return [json.loads(line)["message"] for line in result.out.splitlines()]


def test_the_logs_of_the_edge_and_its_workers_are_one_with_date_and_zone(fleet, kept):
    kept("second", ago=5)
    kept("first", ago=10, process="worker-arm")
    result = fleet("logs")
    first, second = result.out.splitlines()
    assert re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d WARNING fleet\.host: first", first)
    assert second.endswith("second")


def test_a_robots_lines_alone(fleet, kept):
    kept("hot", name="fleet.robot.rex")
    kept("rex: stopped")
    kept("cold", name="fleet.robot.max")
    assert messages(fleet("logs", "rex", "--json")) == ["hot", "rex: stopped"]
    assert messages(fleet("logs", "yard-1/max", "--json")) == ["cold"]


def test_lines_since_and_the_last_ones(fleet, kept):
    for number in range(5):
        kept(str(number), ago=3600.0 * (5 - number))
    assert messages(fleet("logs", "--since", "150m", "--json")) == ["3", "4"]
    assert messages(fleet("logs", "-n", "1", "--json")) == ["4"]


def test_rotated_files_and_what_is_no_line(fleet, kept):
    for number in range(10):
        kept(f"{number} {'x' * 300}", ago=float(10 - number), size=1000)
    with (kept.folder / "main.jsonl").open("ab") as file:
        file.write(b'{"half": \n\xff\xfe\n')
    assert [each[0] for each in messages(fleet("logs", "--json"))] == [str(n) for n in range(10)]


def test_without_a_log_that_is_reported(fleet, kept):
    assert fleet("logs").code == 4


def test_a_log_in_a_place_of_its_own_is_found_while_its_edge_runs(fleet, kept, tmp_path, runtime):
    other = tmp_path / "elsewhere" / "log"
    RotatingLogFile(other / "main.jsonl", JsonFormatter()).close()
    other.mkdir(parents=True)
    (other / "main.jsonl").write_bytes(b"")
    show_log("barn", other, runtime)
    assert fleet("logs").code == 0


def test_what_comes_is_followed_through_a_rotation(kept, place):
    kept("before", ago=1)
    process = subprocess.Popen(
        [sys.executable, "-m", "fleet", "logs", "-f", "--json"], stdout=subprocess.PIPE, text=True
    )
    seen = []
    reader = threading.Thread(target=lambda: seen.extend(iter(process.stdout.readline, "")), daemon=True)
    reader.start()
    try:
        wait_until("it is shown", lambda: any("before" in line for line in seen))
        for number in range(6):
            kept(f"{number} {'x' * 300}", size=500)
            wait_until("it is shown too", lambda expected=number + 2: len(seen) >= expected)
    finally:
        process.kill()
        process.wait()
        reader.join()
        process.stdout.close()
    assert [json.loads(line)["message"][:1] for line in seen] == ["b", "0", "1", "2", "3", "4", "5"]


def test_what_is_sent_to_a_file_is_in_the_file_though_a_table_is_on_the_terminal(place, runtime, tmp_path):
    ours, theirs = pty.openpty()
    errors = tmp_path / "errors"
    environment = os.environ | {"XDG_STATE_HOME": str(tmp_path / "state"), "TERM": "xterm"}
    with errors.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "fleet", "run", "-vv"],
            stdin=theirs,
            stdout=theirs,
            stderr=file,
            env=environment,
        )
    os.close(theirs)
    shown = bytearray()

    def drawn():
        with contextlib.suppress(OSError):  # nobody has the other end any more
            while select.select([ours], [], [], 0.05)[0]:
                shown.extend(os.read(ours, 65536))
        return b"HEALTH" in shown.upper() and b"fleet.robot.rex" in errors.read_bytes()

    try:
        wait_until("there are table and log", drawn)
    finally:
        process.terminate()
        end = time.monotonic() + DEADLINE
        while process.poll() is None and time.monotonic() < end:
            drawn()
        process.kill()
        process.wait()
        os.close(ours)
    assert b"standstill" in errors.read_bytes(), "what was written beside the table"
    assert b"standstill" not in shown
    assert b"fleet.robot.rex" not in shown
    assert re.search(rb"\d{4}-\d\d-\d\dT[\d:.]+[+-]\d\d:\d\d \w+ +fleet", errors.read_bytes())
    kept = (tmp_path / "state" / "fleet" / "yard-1" / "log").glob("*.jsonl")  # the robot is in a worker
    assert any(b"fleet.robot.rex" in each.read_bytes() for each in kept)
