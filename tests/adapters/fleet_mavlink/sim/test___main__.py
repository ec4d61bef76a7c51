"""The simulator as a subprocess, and what its options make of it."""

import asyncio
import json
import math
import signal
import sys

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet.errors import LinkRefused
from fleet.sim.process import SimProcess
from fleet_mavlink.sim.__main__ import _address, _parser, _specs, main
from fleet_mavlink.sim.spec import ZURICH, VehicleSpec


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
        (["--to", "nowhere"], "not HOST:PORT"),
        (["--home", "1,2"], "LATITUDE,LONGITUDE"),
        (["--fault", "los:1"], "did you mean 'loss'"),
        (["--system-id", "250", "--vehicles", "9"], "system id 255"),
        (["--flavour", "px4", "--vehicle", "rover"], "there is no simulated rover on px4"),
    ],
)
def test_impossible_options_are_refused_in_one_line(options, says, capsys):
    assert main(options) == 2
    said = capsys.readouterr().err
    assert said.startswith("fleet_mavlink.sim: ")
    assert says in said
    assert said.count("\n") == 1


def specs(*options):
    return _specs(_parser().parse_args(options))


def test_one_vehicle_is_a_multirotor_on_ardupilot_as_slow_as_the_real_one():
    (spec,) = specs()
    assert (spec.flavour, spec.vehicle, spec.system_id, spec.ready) == ("ardupilot", "multirotor", 1, None)
    assert spec.home == ZURICH


def test_vehicles_stand_in_a_row_to_the_east_and_count_on():
    row = specs("--vehicles", "3", "--system-id", "7", "--spacing", "15", "--home", "47.4,8.5,500,90")
    assert [spec.system_id for spec in row] == [7, 8, 9]
    assert {(spec.home[0], spec.home[2], spec.home[3]) for spec in row} == {(47.4, 500.0, 90.0)}
    metres = [(spec.home[1] - 8.5) * 111_320 * math.cos(math.radians(47.4)) for spec in row]
    assert metres == pytest.approx([0.0, 15.0, 30.0], rel=0.02)


def test_with_orders_from_stdin_there_is_no_vehicle_at_first_unless_it_is_said():
    assert specs("--stdin") == []
    assert len(specs("--stdin", "--vehicles", "2")) == 2


def test_faults_and_accessories_are_those_of_every_vehicle():
    options = (
        "--vehicles",
        "2",
        "--fault",
        "loss:0.1,wind:5",
        "--with",
        "gimbal,camera",
        "--ready-after",
        "3",
    )
    for spec in specs(*options):
        assert dict(spec.faults) == {"loss": 0.1, "wind": 5.0}
        assert (spec.accessories, spec.ready) == (("gimbal", "camera"), 3.0)


@pytest.mark.parametrize(("text", "address"), [("desk:14550", ("desk", 14550)), ("::1:80", ("::1", 80))])
def test_an_address_is_a_host_and_a_port(text, address):
    assert _address(text) == address


@pytest.mark.parametrize("text", ["desk", ":14550", "desk:", "desk:port", "desk:-1"])
def test_what_is_no_address_is_refused(text):
    with pytest.raises(ValueError, match="is not HOST:PORT"):
        _address(text)


@pytest.mark.parametrize("options", [["--to", "a:1", "--tcp", "1"], ["--port", "1", "--tcp", "1"]])
def test_it_waits_in_one_way_or_speaks_first(options, capsys):
    with pytest.raises(SystemExit):
        main(options)
    assert "not allowed with" in capsys.readouterr().err
