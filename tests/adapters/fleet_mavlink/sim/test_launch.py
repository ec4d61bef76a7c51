"""The simulator as a subprocess."""

import asyncio
import signal
import sys

import pytest

from fleet.errors import LinkLost
from fleet_mavlink.sim.launch import SimProcess, SimSpec


async def test_each_vehicle_gets_its_own_port():
    async with SimProcess() as simulator:
        links = [await simulator.add(SimSpec("px4", system_id=number)) for number in (1, 2)]
    assert all(link.startswith("udpout:127.0.0.1:") for link in links)
    assert links[0] != links[1]


async def test_a_fault_is_set_through_the_link():
    async with SimProcess() as simulator:
        link = await simulator.add(SimSpec("px4"))
        await simulator.fault(link, "reboot")
        with pytest.raises(ValueError, match="did you mean 'loss'"):
            await simulator.fault(link, "los")


async def test_the_death_of_the_process_is_told():
    async with SimProcess() as simulator:
        await simulator.add(SimSpec("px4"))
        lost = asyncio.create_task(simulator.lost())
        await asyncio.sleep(0)
        simulator._process.send_signal(signal.SIGKILL)
        with pytest.raises(LinkLost, match="status -9"):
            await lost
        with pytest.raises(LinkLost):
            await simulator.add(SimSpec("px4"))


async def test_before_it_is_started_there_is_nothing_to_ask():
    with pytest.raises(LinkLost):
        await SimProcess().add(SimSpec("px4"))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_a_signal_ends_it_cleanly(number):
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "fleet_mavlink.sim", "--vehicles", "2", stdout=asyncio.subprocess.PIPE
    )
    async with asyncio.timeout(60):
        await process.stdout.readline()
        await process.stdout.readline()
        process.send_signal(number)
        assert await process.wait() == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--to", "nowhere"], b"not HOST:PORT"),
        (["--home", "1,2"], b"LATITUDE,LONGITUDE"),
        (["--fault", "los:1"], b"did you mean 'loss'"),
        (["--system-id", "250", "--vehicles", "9"], b"system id 255"),
    ],
)
async def test_impossible_options_are_refused_in_one_line(options, says):
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "fleet_mavlink.sim", *options),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    _, told = await asyncio.wait_for(process.communicate(), 60)
    assert process.returncode == 2
    assert says in told
    assert told.count(b"\n") == 1
