"""Log lines with date and zone, for people and programs, in files that are bounded and hold nobody up."""

import logging
import re
import threading
import time

import msgspec
import pytest

from fleet.host.logs import rotating_file
from fleet.host.logs.line_format import JsonFormatter, LogLine, TextFormatter, as_text
from fleet.host.logs.rotating_file import RotatingLogFile, log_and_flush, rotated
from fleet.runtime.event_loop import OWNER
from tests.tools.waiting import wait_until


def record(message="hello", level=logging.INFO, name="fleet.robot.rex", error=None):
    return logging.LogRecord(name, level, "x.py", 1, message, (), error)


@pytest.fixture
def opened(tmp_path):
    """Open a log file; close them all."""
    files = []

    def opened(name="a.jsonl", **options):
        files.append(RotatingLogFile(tmp_path / name, JsonFormatter(), **options))
        return files[-1]

    yield opened
    for file in files:
        file.close()


@pytest.fixture
def root():
    """Let a test have the root logger; it is as it was afterwards."""
    logger = logging.getLogger()
    before = logger.handlers[:], logger.level
    yield logger
    logger.handlers[:], logger.level = before


def lines(path):
    return [msgspec.json.decode(line, type=LogLine) for line in path.read_bytes().splitlines()]


def test_a_line_for_people_has_date_zone_level_and_place():
    line = TextFormatter().format(record())
    assert re.fullmatch(
        r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d INFO    fleet\.robot\.rex: hello", line
    )


def test_a_line_for_programs_says_whom_it_is_about_also_from_a_module_of_its_adapter():
    assert msgspec.json.decode(JsonFormatter().format(record()), type=LogLine).robot == "rex"
    token = OWNER.set("max")
    try:
        assert (
            msgspec.json.decode(JsonFormatter().format(record(name="fleet_mavlink.x")), type=LogLine).robot
            == "max"
        )
    finally:
        OWNER.reset(token)
    assert msgspec.json.decode(JsonFormatter().format(record(name="fleet.host")), type=LogLine).robot == ""


def test_a_line_of_many_lines_and_no_text_is_one_line_of_json():
    error = ValueError("a\nb")
    made = JsonFormatter().format(record("x\n\udce9\x1b[31m", error=(ValueError, error, None)))
    assert "\n" not in made
    line = msgspec.json.decode(made, type=LogLine)
    assert "ValueError" in line.error
    assert "\x1b" not in as_text(line)


def test_lines_are_in_the_file_in_order(opened, tmp_path):
    file = opened()
    for number in range(1000):
        file.handle(record(str(number)))
    file.close()
    assert [line.message for line in lines(tmp_path / "a.jsonl")] == [str(n) for n in range(1000)]
    assert (tmp_path / "a.jsonl").stat().st_mode & 0o777 == 0o600


def test_a_file_is_rotated_and_the_oldest_go(opened, tmp_path):
    file = opened(size=2000, keep=3)
    for number in range(60):
        file.handle(record(f"{number} {'x' * 200}"))
        wait_until("it is written", lambda: not file._waiting)
    assert sorted(path.name for path in tmp_path.glob("a.jsonl*")) == [
        "a.jsonl",
        *(f"a.jsonl.{number}" for number in (1, 2, 3)),
    ]
    assert rotated(tmp_path / "a.jsonl", 1).stat().st_size < 3000
    assert lines(tmp_path / "a.jsonl")[-1].message.startswith("59 ")


def test_a_disk_that_hangs_holds_nobody_up_and_memory_is_bounded(opened, monkeypatch):
    free = threading.Event()
    monkeypatch.setattr(rotating_file, "_append", lambda _path, _data: free.wait(20))
    monkeypatch.setattr(rotating_file, "WAITING", 50)
    file = opened()
    for number in range(100):
        file.handle(record(str(number)))
    assert (len(file._waiting), file.lost) == (50, 50)
    free.set()


def test_a_disk_that_fails_is_tried_again(opened, monkeypatch, tmp_path):
    monkeypatch.setattr(rotating_file, "AGAIN_AFTER", 0.01)
    (tmp_path / "in").write_text("the way")
    file = opened("in/a.jsonl")
    file.handle(record())
    wait_until("it is told", lambda: "not written" in file.problem)
    (tmp_path / "in").unlink()
    wait_until("it is written", lambda: (tmp_path / "in" / "a.jsonl").exists() and not file.problem)


@pytest.mark.parametrize("level", [logging.INFO, logging.ERROR, logging.CRITICAL])
def test_a_line_of_any_level_waits_for_no_disk(opened, monkeypatch, level):
    free = threading.Event()
    monkeypatch.setattr(rotating_file, "_append", lambda _path, _data: free.wait(20))
    file = opened()
    began = time.monotonic()
    for _ in range(100):  # a stop of a hundred robots
        file.handle(record("the emergency stop was set", level))
    assert time.monotonic() - began < 10.0, "it would be 20 s for each line"
    free.set()


def test_the_last_words_of_a_process_are_written_before_it_goes_on(opened, root, tmp_path):
    root.addHandler(opened())
    log_and_flush(logging.getLogger("fleet.host"), "this process ends now", within=20.0)
    assert lines(tmp_path / "a.jsonl")[0].level == "CRITICAL"


def test_the_last_words_of_a_process_wait_for_a_disk_that_hangs_for_a_bounded_time(opened, root, monkeypatch):
    free = threading.Event()
    monkeypatch.setattr(rotating_file, "_append", lambda _path, _data: free.wait(20))
    root.addHandler(opened())
    began = time.monotonic()
    log_and_flush(logging.getLogger("fleet.host"), "this process ends now", within=0.1)
    assert 0.1 <= time.monotonic() - began < 15.0, "the disk hangs for 20 s"
    free.set()
