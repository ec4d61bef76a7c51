"""Where the lines of a process go: stderr or the journal, the file that was asked for, and the kept log."""

import io
import logging
import os
import sys

import msgspec
import pytest

from fleet.host.logs import setup
from fleet.host.logs.flood_filter import MOST, WINDOW
from fleet.host.logs.line_format import LogLine
from fleet.host.logs.setup import PASSED_VARIABLES, LogSettings, start_logging

LOG = logging.getLogger("fleet.x")


@pytest.fixture(autouse=True)
def root():
    """Let a test have the root logger; it is as it was afterwards."""
    logger = logging.getLogger()
    handlers, level = logger.handlers[:], logger.level
    yield logger
    logger.handlers[:] = handlers
    logger.setLevel(level)


def messages(path):
    return [msgspec.json.decode(line, type=LogLine).message for line in path.read_text().splitlines()]


def say():
    for level in (logging.DEBUG, logging.INFO, logging.WARNING):
        LOG.log(level, logging.getLevelName(level))


LEVELS = [
    # level asked for on stderr, what is there, and what is in the files
    (logging.ERROR, [], ["INFO", "WARNING"]),
    (logging.WARNING, ["WARNING"], ["INFO", "WARNING"]),
    (logging.INFO, ["INFO", "WARNING"], ["INFO", "WARNING"]),
    (logging.DEBUG, ["DEBUG", "INFO", "WARNING"], ["DEBUG", "INFO", "WARNING"]),
]


@pytest.mark.parametrize(("level", "shown", "kept"), LEVELS)
def test_stderr_has_what_was_asked_for_and_the_files_everything_from_info_on(
    tmp_path, capsys, level, shown, kept
):
    end = start_logging(LogSettings(level, "json", tmp_path / "mine.log"), tmp_path / "log" / "main.jsonl")
    say()
    end()
    assert [msgspec.json.decode(line)["message"] for line in capsys.readouterr().err.splitlines()] == shown
    assert messages(tmp_path / "mine.log") == messages(tmp_path / "log" / "main.jsonl") == kept


def test_the_kept_log_is_for_programs_whatever_people_asked_for(tmp_path, capsys):
    end = start_logging(LogSettings(form="text", file=tmp_path / "mine.log"), tmp_path / "main.jsonl")
    LOG.warning("loud")
    end()
    assert messages(tmp_path / "main.jsonl") == ["loud"]
    for text in ((tmp_path / "mine.log").read_text(), capsys.readouterr().err):
        assert text.endswith("fleet.x: loud\n")


def test_without_files_nothing_below_the_level_of_stderr_is_made(root):
    start_logging(LogSettings(logging.ERROR))
    assert (root.level, LOG.isEnabledFor(logging.WARNING)) == (logging.ERROR, False)


def test_the_files_are_closed_at_the_end_and_stderr_goes_on(root, tmp_path, capsys):
    end = start_logging(LogSettings(), tmp_path / "main.jsonl")
    LOG.warning("before")
    end()
    LOG.warning("after")
    assert (len(root.handlers), messages(tmp_path / "main.jsonl")) == (1, ["before"])
    assert "after" in capsys.readouterr().err


def test_who_starts_it_again_has_each_line_once(capsys):
    start_logging(LogSettings())
    start_logging(LogSettings())
    LOG.warning("once")
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_stderr_is_bounded_and_what_was_left_out_is_told(root, capsys):
    start_logging(LogSettings())
    record = logging.LogRecord("fleet.flood", logging.WARNING, "x.py", 1, "bad message %d", (1,), None)
    for _ in range(MOST + 3):
        root.handle(record)
    assert len(capsys.readouterr().err.splitlines()) == MOST
    record.created += WINDOW
    root.handle(record)
    assert capsys.readouterr().err.endswith("fleet.flood: bad message 1 (3 more like this before)\n")


def test_a_stderr_that_is_replaced_gets_the_lines_from_then_on(monkeypatch):
    start_logging(LogSettings())
    table = io.StringIO()
    monkeypatch.setattr(sys, "stderr", table)
    LOG.warning("beside the table")
    assert "beside the table" in table.getvalue()


@pytest.mark.parametrize("error", [OSError("no space"), ValueError("closed")])
def test_a_stderr_that_fails_does_not_fail_who_logs(monkeypatch, tmp_path, error):
    class Fails(io.StringIO):
        def write(self, _text):
            raise error

    monkeypatch.setattr(logging, "raiseExceptions", False)
    end = start_logging(LogSettings(), tmp_path / "main.jsonl")
    monkeypatch.setattr(sys, "stderr", Fails())
    LOG.warning("loud")
    end()
    assert messages(tmp_path / "main.jsonl") == ["loud"]


class Journal(logging.Handler):
    def __init__(self, level, identifier):
        super().__init__(level)
        self.identifier = identifier


@pytest.mark.parametrize(
    ("asked", "level"), [(logging.WARNING, logging.INFO), (logging.DEBUG, logging.DEBUG)]
)
def test_a_stderr_that_is_the_journal_gets_lines_with_their_fields_from_info_on(
    root, monkeypatch, asked, level
):
    monkeypatch.setattr(setup, "is_journal", lambda descriptor: descriptor == 2)
    monkeypatch.setattr(setup, "JournalHandler", Journal)
    monkeypatch.setattr(sys, "stderr", open(2, "w", closefd=False))  # noqa: SIM115
    start_logging(LogSettings(asked))
    (handler,) = root.handlers
    assert (type(handler), handler.level, handler.identifier) == (Journal, level, "fleet")


def test_workers_log_in_the_form_that_the_edge_was_asked_for_to_files_of_their_own(tmp_path, monkeypatch):
    for variable in PASSED_VARIABLES:
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.chdir(tmp_path)
    LogSettings(logging.DEBUG, "json", setup.Path("fleet.log")).export()
    passed = {name: os.environ[name] for name in PASSED_VARIABLES if name in os.environ}
    own = LogSettings(logging.INFO, "json", tmp_path / "fleet.arm.log")
    assert LogSettings.of_a_worker("arm", passed) == own


def test_a_worker_of_an_edge_that_was_asked_for_nothing_has_no_file():
    assert LogSettings.of_a_worker("arm", {}) == LogSettings(logging.INFO, "text", None)
    assert LogSettings.of_a_worker("arm", {"FLEET_LOG_FORMAT": "xml", "FLEET_LOG_FILE": ""}) == LogSettings(
        logging.INFO, "text", None
    )
