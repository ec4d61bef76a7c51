"""``fleet spool``: what a person sees of what waits, and how it is deleted."""

import resource
import shutil
import time

import pytest

from fleet.clock import SystemClock
from fleet.spool.message import Outgoing
from fleet.spool.spool import Spool, SpoolSettings
from fleet.wire.rules import TrafficClass
from tests.tools.waiting import wait_until


@pytest.fixture
def state(place):
    """Make the edge keep its state in the folder."""
    text = (place / "fleet.yaml").read_text()
    (place / "fleet.yaml").write_text(text.replace("id: yard-1", "id: yard-1, spool: {path: state}"))
    return place / "state"


@pytest.fixture
def filled(state):
    """Leave three messages on disk."""
    spool = Spool(SpoolSettings(folder=state), SystemClock())
    spool.put(Outgoing("T/telemetry", b'{"type": "connected"}', 1))
    spool.put(Outgoing("T/telemetry", b"\xff", 1))
    spool.put(Outgoing("T/navigate/status", b"{}", 1, TrafficClass.STATUS))
    spool.close()
    return state


def test_an_edge_that_has_kept_nothing_is_reported(fleet, state):
    assert fleet("spool", "status").out == f"{state}: 0 messages; no edge uses it\n"
    assert fleet("spool", "export", "--json").json == []
    assert fleet("spool", "purge", "--yes").out == "deleted 0 messages\n"


def test_what_waits_is_shown_by_topic_what_matters_most_first(fleet, filled):
    lines = fleet("spool", "status").out.splitlines()
    assert lines[0].split() == ["CLASS", "MESSAGES", "BYTES", "FIRST", "EXPIRES", "IN", "TOPIC"]
    assert lines[1].split() == ["status", "1", "2", "24", "h", "T/navigate/status"]
    assert lines[2].split() == ["event", "2", "22", "24", "h", "T/telemetry"]


def test_programs_get_all_of_it(fleet, filled):
    found = fleet("spool", "status", "--json").json
    assert (found["messages"], found["bytes"], found["in_use"], found["lost"]) == (3, 24, False, [])
    first, second, _ = fleet("spool", "export", "--json").json
    assert first["payload"] == '{"type": "connected"}'
    assert second["payload_base64"] == "/w=="
    assert first["expires"] - time.time() > 86000


def test_what_waits_is_printed_a_line_a_message(fleet, filled):
    lines = fleet("spool", "export").out.splitlines()
    assert [line.split(maxsplit=2)[1:] for line in lines] == [
        ["T/telemetry", '{"type": "connected"}'],
        ["T/telemetry", "\\xff"],
        ["T/navigate/status", "{}"],
    ]


def test_a_spool_is_emptied_once_it_is_confirmed(fleet, filled, monkeypatch):
    monkeypatch.setattr("click.termui.visible_prompt_func", lambda _: "n")
    assert fleet("spool", "purge").code == 130
    assert fleet("spool", "purge", "--yes", "--json").json == {"deleted": 3}
    assert fleet("spool", "status", "--json").json["messages"] == 0


def test_while_its_edge_runs_a_spool_is_shown_but_not_emptied(fleet, state):
    spool = Spool(SpoolSettings(folder=state), SystemClock())
    spool.put(Outgoing("T/telemetry", b"{}", 1))
    assert fleet("spool", "status", "--json").json["in_use"]
    result = fleet("spool", "purge", "--yes")
    assert result.code == 1
    assert "belongs to another running edge" in result.err
    spool.close()


def test_a_file_that_is_no_spool_is_reported(fleet, state):
    state.mkdir()
    (state / "spool.db").write_text("rubbish" * 1000)
    result = fleet("spool", "status")
    assert (result.code, "cannot be read: file is not a database" in result.err) == (1, True)


def test_after_a_full_disk_a_file_that_was_never_written_is_empty(fleet, state):
    state.mkdir()
    (state / "spool.db").touch()
    result = fleet("spool", "status")
    assert (result.code, result.out) == (0, f"{state}: 0 messages; no edge uses it\n")


@pytest.fixture
def full_disk():
    """Let no file grow beyond a page, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_on_a_full_disk_that_has_no_room_for_an_index_or_a_lock_what_waits_is_shown(fleet, filled, full_disk):
    (filled / "spool.db.lock").unlink()
    (filled / "spool.db.lock").mkdir()  # nobody can make a file there
    result = fleet("spool", "status", "--json")
    assert (result.json["messages"], result.json["in_use"]) == (3, False)


def test_what_cannot_be_read_whole_for_a_full_disk_is_reported_and_no_part_of_it_shown(fleet, state, request):
    spool = Spool(SpoolSettings(folder=state.with_name("other")), SystemClock())
    spool.put(Outgoing("T/telemetry", b"{}", 1))
    wait_until("it is on disk", lambda: (state.with_name("other") / "spool.db-wal").stat().st_size > 0)
    state.mkdir()
    for name in ("spool.db", "spool.db-wal"):
        shutil.copy(state.with_name("other") / name, state / name)
    spool.close()
    request.getfixturevalue("full_disk")
    result = fleet("spool", "status")
    assert result.code == 1
    assert "is its disk full?" in result.err
