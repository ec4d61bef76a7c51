"""The recorder as a process: killed at any time it loses a second at the most, and every file opens."""

import contextlib
import os
import subprocess
import sys
import time

import msgspec
import pytest

from fleet.link.tap import LinkFrame, LinkFrames
from fleet.model.report import BatteryReport
from fleet.record.ring import files_in
from fleet.record.task import Bounds, RecordTask
from fleet.wire.databus import encode_report
from tests.tools.waiting import DEADLINE, wait_until

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
TOPIC = "/yard-1/rex/battery"
FRAMES = "/yard-1/rex/frames"
MOST_LOST = 1.0  # s
BUSY = 10.0  # times as much as a busy computer may make of it
KILLS, SOAK_KILLS = 3, 50


def frames_at(stamp):
    """Return a message of frames, much of which zstd cannot make smaller."""
    frames = [LinkFrame(stamp, "in", os.urandom(64)) for _ in range(200)]
    return msgspec.json.encode(LinkFrames(stamp, "rex", "udpin:0.0.0.0:14550", frames))


@contextlib.contextmanager
def recorder(task):
    """Run a recorder; yields its process."""
    command = [sys.executable, "-m", "fleet.record.program"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        try:
            process.stdin.write(msgspec.json.encode(task))
            process.stdin.close()
            yield process
        finally:
            process.kill()


@pytest.fixture
def yard(play_edge):
    return play_edge("yard-1", robots={"rex": {"twin": TWIN}})


def test_a_recorder_that_is_killed_lost_a_second_at_the_most_and_every_file_opens(
    runtime, yard, tmp_path, read_back, pytestconfig
):
    folder, lost = tmp_path / "recordings", []
    kills = SOAK_KILLS if pytestconfig.getoption("--soak") else KILLS
    for number in range(1, kills + 1):
        last = 0.0

        def is_recorded(least=number):
            """Report once more; return whether this recorder has written something."""
            nonlocal last
            last = time.time()
            yard.bus.reports.put(f"cw/{TWIN}/data/battery", encode_report(BatteryReport(last, 50.0), 1))
            yard.bus.reports.put("fleet/yard-1/frames/main", frames_at(last))
            files = files_in(folder) if folder.is_dir() else []
            if not files or not files[-1].stat().st_size:  # it was only just opened
                return False
            return len(files) == least and any(topic == TOPIC for topic, _, _ in read_back(files[-1]))

        with recorder(RecordTask(str(folder), Bounds(free=0))) as process:
            wait_until("a recorded report", is_recorded)
            until = time.monotonic() + 0.17 * (number % 7)
            wait_until("more reports", lambda: not is_recorded() or time.monotonic() > until)  # noqa: B023
            killed = time.time()
            process.kill()
            process.wait(DEADLINE)
        found = read_back(files_in(folder)[-1])
        newest = max(each.publish_time / 1e9 for topic, _, each in found if topic == TOPIC)
        lost.append(killed - newest)
    assert min(lost) < MOST_LOST
    assert max(lost) < BUSY * MOST_LOST
    assert len(files_in(folder)) == kills
    assert {topic for file in files_in(folder) for topic, _, _ in read_back(file)} >= {TOPIC, FRAMES}


def test_it_says_why_it_cannot_record(runtime, tmp_path):
    (tmp_path / "file").write_text("")
    with recorder(RecordTask(str(tmp_path / "file" / "recordings"))) as process:
        assert "cannot record into" in msgspec.json.decode(process.stdout.readline())
        assert process.wait(DEADLINE) == 1


def test_a_task_that_cannot_be_read_is_refused():
    command = [sys.executable, "-m", "fleet.record.program"]
    done = subprocess.run(command, input=b"{}", capture_output=True, timeout=DEADLINE, check=False)
    assert (done.returncode, b"cannot be read" in done.stderr) == (1, True)
