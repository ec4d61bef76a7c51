"""The simulator as a subprocess."""

import asyncio
import json
import signal
import sys

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet.errors import LinkRefused
from fleet.sim.process import SimProcess
from fleet_mavlink.sim.spec import VehicleSpec


async def test_a_vehicle_has_its_own_port_and_is_gone_with_whoever_asked_for_it():
    async with SimProcess("fleet_mavlink.sim") as simulator:
        async with (
            simulator.robot(VehicleSpec("px4")) as one,
            simulator.robot(VehicleSpec("px4", system_id=2)) as two,
        ):
            assert one.startswith("udpout:127.0.0.1:")
            assert one != two
            await simulator.fault(one, "reboot")
            with pytest.raises(LinkRefused, match="did you mean 'loss'"):
                await simulator.fault(two, "los")
        with pytest.raises(LinkRefused, match="no simulated robot"):
            await simulator.fault(one, "reboot")


@pytest.mark.parametrize(
    ("flavour", "kind", "number"),
    [
        ("ardupilot", "rover", mav.MAV_TYPE_GROUND_ROVER),
        ("ardupilot", "plane", mav.MAV_TYPE_FIXED_WING),
        ("px4", "vtol", mav.MAV_TYPE_VTOL_RESERVED2),
    ],
)
async def test_vehicles_of_each_kind_wait_on_a_link(flavour, kind, number):
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "fleet_mavlink.sim", "--tcp", "0", "--flavour", flavour, "--vehicle", kind),
        stdout=asyncio.subprocess.PIPE,
    )
    async with asyncio.timeout(60):
        url = json.loads(await process.stdout.readline())["url"]
        reader, writer = await asyncio.open_connection("127.0.0.1", int(url.rpartition(":")[2]))
        parser, seen = mav.MAVLink(None), set()
        parser.robust_parsing = True
        while not seen:
            messages = parser.parse_buffer(await reader.read(4096)) or []
            seen = {each.type for each in messages if each.get_type() == "HEARTBEAT"}
        writer.close()
        await writer.wait_closed()
        process.terminate()
        await process.communicate()
    assert seen == {number}


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
        (["--flavour", "px4", "--vehicle", "rover"], b"there is no simulated rover on px4"),
    ],
)
async def test_impossible_options_are_refused_in_one_line(options, says):
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "fleet_mavlink.sim", *options),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    _, stderr = await asyncio.wait_for(process.communicate(), 60)
    assert process.returncode == 2
    assert says in stderr
    assert stderr.count(b"\n") == 1
