"""State of other versions: that of fleet 0.1.0 is read and kept, that of a newer fleet is refused.

``tests/data/state-0.1.0`` is what an edge of 0.1.0 left that was killed while the cloud was away: ``beast``
has its emergency stop set, ``ghost`` had taken off and had just begun to land, which no disk had yet.
"""

import json
import shutil
import sqlite3
from pathlib import Path

import msgspec
import pytest

from fleet.cli.main import main
from fleet.errors import StateError, StateNewer
from fleet.history import reader as history_look
from fleet.history.event_filter import EventFilter
from fleet.history.store import HISTORY, History
from fleet.host.journal.execution_journal import (
    FORMAT,
    ExecutionJournal,
    StartedCommand,
    execution_journal_file,
)
from fleet.host.journal.journal import Journal
from fleet.host.journal.journal_file import LOST
from fleet.model.event import EventKind, EventReport
from fleet.runtime.state_format import format_of, refuse_newer
from fleet.spool import inspection as spool_look
from fleet.spool.message import DeliveryOutcome
from fleet.spool.spool import Spool, SpoolSettings
from fleet.spool.state_folder import JOURNAL, SPOOL
from fleet.testing.clock import ManualClock
from fleet_mavlink.events import EventDictionary
from tests.tools.waiting import wait_until

KEPT = Path(__file__).parents[2] / "data" / "state-0.1.0"
KILLED_AT = 1795386999.0  # Unix s
FILES = {
    "cache/d9465296.json.xz",
    "fleet.yaml",
    "runtime/begun-yard-1.main",
    "state/history.db",
    "state/journal.db",
    "state/journal.db-wal",
    "state/log/main.jsonl",
    "state/spool.db",
}
NEWER = "it has format 99, of a newer fleet; this one reads up to format"
LANDING = "865ffe89f1ad505d3a7482b8d4962c81"
TAKEOFF = "e2499f7b9840621633affdd517d1ac43"


@pytest.fixture
def clock():
    """Return the time one minute after the edge of 0.1.0 was killed."""
    return ManualClock(time=KILLED_AT + 60.0)


@pytest.fixture
def left(tmp_path):
    """Return a copy of what the edge of 0.1.0 left."""
    return Path(shutil.copytree(KEPT, tmp_path / "left"))


@pytest.fixture
def journal(left, clock):
    """Open journals, of one process after the other."""
    opened = []

    def journal():
        while opened:
            opened.pop().close()
        opened.append(Journal(left / "state", clock, execution_journal_file(left / "runtime", "yard-1")))
        return opened[-1]

    yield journal
    while opened:
        opened.pop().close()


@pytest.fixture
def logs(left, monkeypatch, capsys):
    """Run ``fleet logs`` on the state; return its lines and its notes."""
    (left / "fleet").mkdir()
    (left / "fleet" / "yard-1").symlink_to(left / "state", target_is_directory=True)
    monkeypatch.setenv("XDG_STATE_HOME", str(left))
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(left / "none"))

    def logs():
        assert main(["logs", "--json"]) == 0
        out, notes = capsys.readouterr()
        return [json.loads(line) for line in out.splitlines()], notes

    return logs


def delivered(folder, clock):
    """Send all that a folder's spool holds; return topics and payloads."""
    spool = Spool(SpoolSettings(folder=folder), clock)
    sent = []

    def nothing_waits():
        batch = spool.take(clock.monotonic(), window=100, reserve=0, size=10**6)
        spool.settle([(message, DeliveryOutcome.ACKED) for message in batch])
        sent.extend((message.topic, message.payload) for message in batch)
        return not spool.waiting

    spool.go_online()
    clock.advance(1.0)
    wait_until("nothing waits", nothing_waits)
    spool.close()
    assert spool.problem == ""
    return sent


def number(path, value=None):
    """Return the format number of an SQLite file, after setting it."""
    database = sqlite3.connect(path)
    if value is not None:
        database.execute(f"PRAGMA user_version = {value}")
    found = database.execute("PRAGMA user_version").fetchone()[0]
    database.close()
    return found


def test_every_file_that_0_1_0_left_is_known_here():
    assert {str(path.relative_to(KEPT)) for path in KEPT.rglob("*") if path.is_file()} == FILES


def test_a_stop_that_was_set_under_0_1_0_is_still_set_and_a_released_one_is_not(journal):
    beast = journal().robot("beast")
    assert "fixture of 0.1.0" in beast.latched
    assert journal().robot("beast").latched == beast.latched
    assert journal().robot("ghost").latched == ""


@pytest.mark.parametrize("lost", [JOURNAL, "begun"])
def test_a_stop_of_0_1_0_is_still_set_by_either_of_its_two_records(left, journal, lost):
    for path in [*(left / "state").glob(f"{lost}*"), *(left / "runtime").glob(f"{lost}*")]:
        path.unlink()
    assert "fixture of 0.1.0" in journal().robot("beast").latched


def test_what_0_1_0_had_begun_is_not_carried_out_again(journal):
    for _ in range(2):  # the second start has it from the disk
        past = {each.identity: each for each in journal().robot("ghost").past}
        assert (past[TAKEOFF].outcome, past[LANDING].outcome) == ("completed", "")
        assert "was not seen to end" in past[LANDING].verdict


def test_what_waited_for_the_cloud_under_0_1_0_is_delivered_once_and_in_order(left, clock):
    rows = spool_look.messages(left / "state")
    kept = [(message.topic, message.payload) for message in rows]
    assert len(kept) == 13
    sent = delivered(left / "state", clock)
    assert sorted(sent) == sorted(kept)
    for topic in {topic for topic, _ in kept}:
        assert [each for each in sent if each[0] == topic] == [each for each in kept if each[0] == topic]
    assert delivered(left / "state", clock) == []


def test_the_history_of_0_1_0_is_read_and_goes_on(left, clock):
    before = history_look.read(left / "state", EventFilter())
    assert len(before) == 17
    assert [event.text for event in before if event.kind is EventKind.RELEASE] == [
        "the emergency stop was released"
    ]
    history = History(left / "state", clock)
    history.add("ghost", EventReport(clock.time(), EventKind.HEALTH, "ok again"))
    history.close()
    assert [event.text for event in history_look.read(left / "state", EventFilter())] == [
        *(event.text for event in before),
        "ok again",
    ]


def test_the_log_of_0_1_0_is_shown(logs):
    lines, notes = logs()
    assert (len(lines), notes) == (13, "")
    assert lines[7]["message"].endswith("fixture of 0.1.0")


def test_the_list_of_events_that_0_1_0_had_cached_is_read(left):
    (path,) = (left / "cache").iterdir()
    assert len(EventDictionary(path.read_bytes())) > 0


@pytest.mark.parametrize("name", [JOURNAL, SPOOL, HISTORY])
def test_the_files_of_0_1_0_have_format_1(left, name):
    assert number(left / "state" / name) == 1


def test_a_journal_of_a_newer_fleet_is_kept_aside_and_every_robot_is_stopped(left, journal, caplog):
    path = left / "state" / JOURNAL
    number(path, 99)
    assert [journal().robot(name).latched for name in ("ghost", "other")] == [LOST, LOST]
    assert NEWER in caplog.text
    assert number(path.with_name(f"{JOURNAL}.format-99")) == 99
    assert number(path) == 2


def test_begun_commands_of_a_newer_fleet_stop_every_robot(left, journal, caplog):
    path = execution_journal_file(left / "runtime", "yard-1")
    path.write_bytes(b'["format",99]\n' + path.read_bytes())
    ghost = journal().robot("ghost")
    assert NEWER in ghost.latched
    ghost.latch("")
    assert [bool(journal().robot(name).latched) for name in ("ghost", "beast", "other")] == [
        False,
        True,
        True,
    ]
    assert NEWER in caplog.text


def test_begun_commands_begin_with_their_format(tmp_path):
    begun = ExecutionJournal(tmp_path / "begun-yard-1.main")
    for identity in ("r1", "r2"):
        begun.clear()
        begun.add(StartedCommand("rex", identity, "land", False, 1.0))
        begun.add(StartedCommand("rex", identity, "land", False, 2.0))
        content = (tmp_path / "begun-yard-1.main").read_bytes().partition(b"\0")[0]
        assert [json.loads(line)[0] for line in content.splitlines()] == ["format", "begin", "begin"]
        assert json.loads(content.splitlines()[0]) == ["format", FORMAT]
        with begun.all_rows() as rows:
            assert [row.stamp for row in rows] == [1.0, 2.0]
    begun.close()


def test_a_spool_of_a_newer_fleet_is_kept_aside_and_reported(left, clock):
    path = left / "state" / SPOOL
    number(path, 99)
    with pytest.raises(StateError, match=NEWER):
        spool_look.backlog(left / "state")
    with pytest.raises(StateError, match=NEWER):
        spool_look.purge(left / "state")
    spool = Spool(SpoolSettings(folder=left / "state"), clock)
    assert spool.problem == f"{SPOOL} could not be read and was set aside as {SPOOL}.format-99"
    spool.close()
    number(path.with_name(f"{SPOOL}.format-99"), 1)
    shutil.move(path.with_name(f"{SPOOL}.format-99"), path)  # as its newer fleet gets it back
    assert len(delivered(left / "state", clock)) == 13


def test_a_history_of_a_newer_fleet_is_refused_and_kept_aside(left, clock, caplog):
    path = left / "state" / HISTORY
    number(path, 99)
    with pytest.raises(StateError, match=NEWER):
        history_look.read(left / "state", EventFilter())
    history = History(left / "state", clock)
    history.add("ghost", EventReport(clock.time(), EventKind.HEALTH, "ok"))
    history.close()
    assert NEWER in caplog.text
    assert number(path.with_name(f"{HISTORY}.format-99")) == 99
    assert [event.text for event in history_look.read(left / "state", EventFilter())] == ["ok"]


def test_lines_of_a_newer_fleets_log_are_left_out_and_counted(left, logs):
    path = left / "state" / "log" / "main.jsonl"
    line = json.loads(path.read_text().splitlines()[-1])
    with path.open("a") as log:
        log.write(json.dumps({**line, "format": 99}) + "\n")
    lines, notes = logs()
    assert len(lines) == 13
    assert "left out: 1 line of a newer fleet" in notes


def test_the_newest_format_is_read_and_one_beyond_it_is_not():
    refuse_newer(1, 1)
    with pytest.raises(StateNewer, match="format 2, of a newer fleet; this one reads up to format 1"):
        refuse_newer(2, 1)


def test_the_number_of_a_file_is_read_whatever_else_a_newer_fleet_wrote():
    assert format_of(b'{"edges": 3, "format": 7}') == 7


@pytest.mark.parametrize("data", [b"{}", b"[]", b'{"format": "7"}', b'{"format": 7', b""])
def test_a_file_without_a_number_cannot_be_read(data):
    with pytest.raises(msgspec.DecodeError):
        format_of(data)
