"""Logs on board: listed and read whole, over links that lose some of them."""

import asyncio
import base64

import pytest

from fleet import NotReady, Refused, TimedOut
from fleet_mavlink.sim.logs import content

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


async def whole(it, log, piece=20_000):
    """Read a log as a client does, piece by piece."""
    data = b""
    while len(data) < log["size"]:
        count = min(piece, log["size"] - len(data))
        answer = await it.do("read_log", id=log["id"], offset=len(data), count=count)
        data += base64.b64decode(answer["data"])
    return data


@both
def test_logs_are_listed_and_read(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            logs = await it.do("list_logs")
            assert [log["size"] for log in logs] == [40_000, 12_345, 3_600]
            assert logs[0]["id"] == (1 if flavour == "ardupilot" else 0)
            for log in logs:
                assert await whole(it, log) == content(log["id"], log["size"])

    run_in_sim_time(main())


def test_a_log_is_whole_although_pieces_got_lost_and_came_out_of_order(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            it.sim.set_fault("loss", 0.1)
            it.sim.set_fault("reorder", 0.1)
            log = (await it.do("list_logs"))[1]
            assert await whole(it, log) == content(log["id"], log["size"])

    run_in_sim_time(main())


def test_logs_are_not_read_from_what_is_armed(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            await it.do("arm")
            with pytest.raises(Refused, match="armed"):
                await it.do("list_logs")
            with pytest.raises(Refused, match="armed"):
                await it.do("read_log", id=1)

    run_in_sim_time(main())


def test_arming_ends_a_reading(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            it.sim.equipment.logs.pending = list
            reading = asyncio.ensure_future(it.do("read_log", id=1))
            await asyncio.sleep(0.2)
            await it.do("arm")
            with pytest.raises(NotReady, match="armed meanwhile"):
                await reading

    run_in_sim_time(main())


@pytest.mark.parametrize(
    "bad", [{"id": -1}, {"id": 70_000}, {"id": 1, "offset": -5}, {"id": 1, "count": 10**6}]
)
def test_a_reading_beyond_any_log_is_refused(run_in_sim_time, sim_flight, bad):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            with pytest.raises(Refused, match="must be"):
                await it.do("read_log", **bad)

    run_in_sim_time(main())


def test_a_log_that_does_not_come_is_given_up(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            with pytest.raises(TimedOut, match="stopped at 0 bytes"):
                await it.do("read_log", id=99)

    run_in_sim_time(main())
