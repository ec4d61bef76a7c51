"""Log lines in the journal of systemd: their fields, and that no text adds one."""

import logging
import os
import socket

import pytest

from fleet.host.logs import systemd_journal
from fleet.host.logs.systemd_journal import JournalHandler, datagram, fields_of, is_journal


def parsed(data):
    """Return the fields of a datagram, as journald reads them."""
    fields = {}
    while data:
        name, _, rest = data.partition(b"\n")
        size = int.from_bytes(rest[:8], "little")
        fields[name.decode()] = rest[8 : 8 + size].decode()
        assert rest[8 + size : 9 + size] == b"\n"
        data = rest[9 + size :]
    return fields


@pytest.fixture
def journald(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "socket"))
        listener.settimeout(10)
        yield listener


@pytest.fixture
def logger(journald):
    handler = JournalHandler(logging.INFO, "fleet", journald.getsockname())
    logger = logging.getLogger("fleet.robot.rex")
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    yield logger
    logger.setLevel(logging.NOTSET)
    logger.removeHandler(handler)
    handler.close()


@pytest.mark.parametrize(("level", "priority"), [("error", "3"), ("warning", "4"), ("info", "6")])
def test_a_line_has_priority_logger_and_robot_as_fields(journald, logger, level, priority):
    getattr(logger, level)("battery %d %%", 12)
    assert parsed(journald.recv(65536)) == {
        "MESSAGE": "battery 12 %",
        "PRIORITY": priority,
        "SYSLOG_IDENTIFIER": "fleet",
        "FLEET_LOGGER": "fleet.robot.rex",
        "FLEET_ROBOT": "rex",
    }


def test_no_text_can_add_a_field(journald, logger):
    logger.error("x\nPRIORITY=0\n_UID=0")
    found = parsed(journald.recv(65536))
    assert found["PRIORITY"] == "3"
    assert "_UID" not in found


def test_a_traceback_is_part_of_the_message(journald, logger):
    try:
        int("no number")
    except ValueError:
        logger.exception("failed")
    assert "ValueError: invalid literal" in parsed(journald.recv(65536))["MESSAGE"]


def test_a_journal_that_takes_nothing_delays_nobody(tmp_path):
    handler = JournalHandler(logging.INFO, "fleet", tmp_path / "gone")
    handler.emit(logging.LogRecord("fleet", logging.ERROR, "", 1, "lost", (), None))
    handler.close()


def test_empty_fields_are_left_out_of_a_line(logger):
    record = logging.LogRecord("fleet.bus", logging.DEBUG, "", 1, "seen", (), None)
    fields = fields_of(systemd_journal.line_of(record, logging.Formatter()), record.levelno, "fleet")
    assert "FLEET_ROBOT" not in fields
    assert fields["PRIORITY"] == "7"
    assert parsed(datagram(fields)) == fields


def test_stderr_is_the_journal_only_when_systemd_says_so_of_this_very_stream(tmp_path, monkeypatch):
    monkeypatch.setattr(systemd_journal, "SOCKET", tmp_path)
    with (tmp_path / "stream").open("wb") as stream:
        found = os.fstat(stream.fileno())
        named = {"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"}
        assert is_journal(stream.fileno(), named)
        assert not is_journal(stream.fileno(), {"JOURNAL_STREAM": "1:2"})
        assert not is_journal(stream.fileno(), {})
