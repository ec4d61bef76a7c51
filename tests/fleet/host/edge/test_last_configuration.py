"""What an edge last ran with is kept whole, without a secret in it, and read by its format."""

import asyncio
import json
import threading

import pytest

from fleet.clock import SystemClock
from fleet.config.difference import ComparedFile, difference, not_shown
from fleet.errors import StateError, StateNewer
from fleet.host.edge import last_configuration as module
from fleet.host.edge.last_configuration import FILE, LastConfigurationFile, keep, last_configuration
from fleet.model.change import ChangeKind

OUTLINE = ComparedFile("yard", {"cloud": {"token": '"cw_secret"'}}, {"rex": {"twin": '"1"', "pin": '"4711"'}})


def test_what_is_kept_is_found_the_same_and_shows_no_value(tmp_path):
    keep(tmp_path, OUTLINE, 12.0)
    last = last_configuration(tmp_path)
    assert last.stamp == 12.0
    now = OUTLINE.digest(last.key.encode())
    assert {change.kind for change in difference(last.outline, now, not_shown)} == {ChangeKind.UNTOUCHED}
    text = (tmp_path / FILE).read_text()
    assert "cw_secret" not in text
    assert "4711" not in text
    assert (tmp_path / FILE).stat().st_mode & 0o077 == 0


def test_it_is_replaced_whole(tmp_path):
    keep(tmp_path, OUTLINE, 12.0)
    (tmp_path / "configuration.new").write_text("half a fi")  # of an edge that was killed meanwhile
    assert last_configuration(tmp_path).stamp == 12.0
    keep(tmp_path, OUTLINE, 13.0)
    assert [path.name for path in tmp_path.iterdir()] == [FILE]
    assert last_configuration(tmp_path).stamp == 13.0


def test_without_one_there_is_none(tmp_path):
    assert last_configuration(tmp_path) is None


def test_one_of_a_newer_fleet_is_refused_and_one_that_is_damaged_too(tmp_path):
    keep(tmp_path, OUTLINE, 12.0)
    document = json.loads((tmp_path / FILE).read_text()) | {"format": 2, "outline": "other"}
    (tmp_path / FILE).write_text(json.dumps(document))
    with pytest.raises(StateNewer, match="format 2, of a newer fleet"):
        last_configuration(tmp_path)
    (tmp_path / FILE).write_text("{")
    with pytest.raises(StateError, match="cannot be read"):
        last_configuration(tmp_path)


def test_a_folder_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(StateError):
        keep(tmp_path / "taken", OUTLINE, 12.0)


async def test_the_later_of_two_configurations_stays_however_slow_the_disk(tmp_path, monkeypatch):
    begun, disk = threading.Event(), threading.Event()

    def outline(running):
        if running == "first":
            begun.set()
            assert disk.wait(10)
        return ComparedFile(running, {}, {})

    monkeypatch.setattr(module, "outline_of", outline)
    file = LastConfigurationFile(tmp_path, SystemClock())
    first = asyncio.create_task(file.write("first"))
    assert await asyncio.to_thread(begun.wait, 10)
    second = asyncio.create_task(file.write("second"))
    done, _ = await asyncio.wait({second}, timeout=0.1)  # without an order it ends before the first
    disk.set()
    await asyncio.gather(first, second)
    key = last_configuration(tmp_path).key.encode()
    assert last_configuration(tmp_path).outline == ComparedFile("second", {}, {}).digest(key)
    assert not done


async def test_a_write_that_fails_is_only_logged(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(module, "outline_of", lambda _: OUTLINE)
    (tmp_path / "taken").write_text("")
    await LastConfigurationFile(tmp_path / "taken", SystemClock()).write("any")
    assert "is not stored for fleet diff" in caplog.text
