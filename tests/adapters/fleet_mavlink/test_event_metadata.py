"""The list of events: from the cache by its checksum, else from the vehicle, while it is on the ground."""

import asyncio
import contextlib
import json
import lzma
import zlib

import pytest

from fleet_mavlink.constants import PX4
from fleet_mavlink.event_metadata import EventKeeper, cache
from fleet_mavlink.events import PATH
from fleet_mavlink.messages import SystemTime
from fleet_mavlink.sim.event_list import PACKED
from fleet_mavlink.sim.files import SimFiles
from tests.adapters.fleet_mavlink.file_server import CRC, OPEN, Server

SMALL = lzma.compress(json.dumps({"version": 2, "components": {}}).encode())


@pytest.fixture
def keep(run_answered):
    """Run a test beside the keeper of a vehicle on PX4 that serves a list."""

    def run(test, *, autopilot=PX4, files=None):
        server = Server({PATH: PACKED} if files is None else files)

        async def main(it):
            it._autopilot = autopilot
            it.beat()
            keeping = asyncio.ensure_future(EventKeeper(it.vehicle).run())
            await test(it, server)
            keeping.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await keeping

        run_answered(server.answer, main)
        return server

    return run


async def listed(it, seconds=10.0):
    """Let time pass until a list is known; return how many events it has."""
    async with asyncio.timeout(seconds):
        while it.vehicle.dictionary is None:  # noqa: ASYNC110 - time jumps here
            await asyncio.sleep(0.1)
    return len(it.vehicle.dictionary)


def kept(data):
    return cache() / f"{zlib.crc32(data):08x}.json.xz"


def test_a_list_is_read_and_kept_by_its_checksum(keep):
    async def test(it, server):
        assert await listed(it) == 4

    keep(test)
    assert kept(PACKED).read_bytes() == PACKED
    assert [each.name for each in cache().iterdir()] == [kept(PACKED).name]


def test_the_name_of_a_kept_list_has_all_digits_of_its_checksum(keep):
    lists = (lzma.compress(json.dumps({"version": 2, "components": {}, "n": n}).encode()) for n in range(999))
    data = next(each for each in lists if zlib.crc32(each) < 1 << 28)

    async def test(it, server):
        assert await listed(it) == 0

    keep(test, files={PATH: data})
    assert [len(each.name) for each in cache().iterdir()] == [len("01234567.json.xz")]


def test_a_kept_list_is_only_asked_for_its_checksum(keep):
    kept(PACKED).parent.mkdir(parents=True)
    kept(PACKED).write_bytes(PACKED)

    async def test(it, server):
        assert await listed(it) == 4

    assert [opcode for _, opcode, _ in keep(test).requests] == [CRC]


@pytest.mark.parametrize("broken", [b"", b"not a list", PACKED[:40]])
def test_a_kept_list_that_is_broken_is_read_again_and_replaced(keep, broken):
    kept(PACKED).parent.mkdir(parents=True)
    kept(PACKED).write_bytes(broken)

    async def test(it, server):
        assert await listed(it, 60.0) == 4

    keep(test)
    assert kept(PACKED).read_bytes() == PACKED


def test_a_list_is_used_where_nothing_can_be_kept(keep, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))

    async def test(it, server):
        assert await listed(it) == 4

    keep(test)


def test_nothing_is_read_in_the_air_however_long_it_flies(keep):
    async def test(it, server):
        it.silent = True  # its beats come from here
        for _ in range(2 * 3700):
            it.beat(armed=True)
            await asyncio.sleep(0.5)
        assert server.requests == []
        it.silent = False
        it.beat()
        assert await listed(it) == 4

    keep(test)


def test_a_vehicle_without_a_list_is_asked_three_times_in_a_minute_and_then_no_more(keep, caplog):
    caplog.set_level("INFO")

    async def test(it, server):
        await asyncio.sleep(600.0)
        assert it.vehicle.dictionary is None

    assert [opcode for _, opcode, _ in keep(test, files={}).requests] == [CRC] * 3
    assert "its events are not explained: it refused a file: error 10" in caplog.text


@pytest.mark.parametrize("data", [b"", b"not a list"])
def test_a_file_that_is_no_list_is_told_and_nothing_breaks(keep, caplog, data):
    caplog.set_level("INFO")

    async def test(it, server):
        await asyncio.sleep(100.0)
        assert it.vehicle.dictionary is None

    assert len(keep(test, files={PATH: data}).asked(OPEN)) == 3
    assert "its events are not explained" in caplog.text


def test_after_a_restart_the_list_is_read_again_for_it_may_have_another_firmware(keep):
    async def test(it, server):
        assert await listed(it) == 4
        server.files = SimFiles({PATH: SMALL})
        it.receive(SystemTime(60_000))
        it.receive(SystemTime(500))
        await asyncio.sleep(5.0)
        assert len(it.vehicle.dictionary) == 0

    keep(test)


def test_ardupilot_which_sends_no_events_is_asked_for_no_list(keep):
    async def test(it, server):
        await asyncio.sleep(60.0)

    assert keep(test, autopilot=3).requests == []


def test_the_cache_is_in_the_users_folder_unless_another_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache() == tmp_path / "fleet" / "mavlink-events"
    for unset in (
        lambda: monkeypatch.setenv("XDG_CACHE_HOME", ""),
        lambda: monkeypatch.delenv("XDG_CACHE_HOME"),
    ):
        unset()
        monkeypatch.setenv("HOME", str(tmp_path / "anna"))
        assert cache() == tmp_path / "anna" / ".cache" / "fleet" / "mavlink-events"


def test_an_autopilot_without_files_is_flown_all_the_same(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            assert it.adapter._session.vehicle.dictionary is None

    run_in_sim_time(main())
