"""Ground stations that were written by others, beside the edge: MAVSDK (C++) and MAVProxy."""

import asyncio
import contextlib
import re
import socket
import sys
from pathlib import Path

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.action import ActionError
from mavsdk.plugins.mission_raw import MissionItem, MissionRawError
from mavsdk.plugins.param import ParamError

from fleet.testing.robot import LoopRobot, serve
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.sim.params import ardupilot_params
from tests.tools.ports import free_ports

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"
LIMIT = 60  # seconds for one wait, on a busy computer
MAVSDK_SYSTEM = 245  # of its ground stations


@pytest.fixture
def two_free_udp_ports():
    """Find two UDP ports that nobody uses."""
    return free_ports(2, socket.SOCK_DGRAM)


@contextlib.asynccontextmanager
async def flown(port, **watcher):
    """Run the adapter of a simulated ArduCopter that is shown at a port."""
    async with shown("multirotor", {"link": f"udpout:127.0.0.1:{port}", **watcher}) as running:
        yield running


@contextlib.asynccontextmanager
async def shown(vehicle, *watchers):
    """Run the adapter of a simulated vehicle on ArduPilot, with watchers."""
    entry = {
        "name": "kestrel",
        "twin": TWIN,
        "adapter": "mavlink",
        "link": f"sim:ardupilot?vehicle={vehicle}&speed=3&ready=1",
        "watchers": list(watchers),
    }
    robot = LoopRobot("kestrel", MavlinkAdapter.limits.model_copy(update={"speed": 25.0}))
    adapter = MavlinkAdapter(MavlinkConfig.model_validate(entry), robot)
    running = asyncio.ensure_future(serve(adapter))
    try:
        async with asyncio.timeout(LIMIT):
            await robot.until(lambda: robot.is_connected, LIMIT)
            await adapter._session.vehicle.until(lambda state: bool(state.prearm_ok), LIMIT)
        yield adapter, robot
    finally:
        robot.close()
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running


@contextlib.asynccontextmanager
async def mavsdk(port):
    """Give the vehicle that MAVSDK finds at a port."""
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as station:
        await station.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = await station.first_autopilot(timeout_s=LIMIT)
        assert system is not None
        yield system


async def wait_for(stream, happened):
    """Return the first value of a subscription for which something is true."""
    async with asyncio.timeout(LIMIT):
        async for value in stream:
            if happened(value):
                return value
    raise AssertionError("the subscription ended")


def item(seq):
    """Return a waypoint."""
    return MissionItem(seq, 6, 16, int(seq == 0), 1, 0, 0, 0, 0, 473977420, 85455940, 10.0, 0)


async def test_mavsdk_watches_and_may_not_command(free_udp_port):
    async with flown(free_udp_port) as (adapter, robot), mavsdk(free_udp_port) as system:
        telemetry, param, mission = TelemetryAsync(system), ParamAsync(system), MissionRawAsync(system)
        await wait_for(
            telemetry.subscribe_position(), lambda place: abs(place.latitude_deg - 47.397742) < 0.01
        )
        speed = await param.get_param_float("WPNAV_SPEED")
        assert len((await param.get_all_params()).float_params) > 10
        await mission.download_mission()
        with pytest.raises(ActionError, match="DENIED"):
            await ActionAsync(system).arm()
        with pytest.raises(ParamError):
            await param.set_param_float("WPNAV_SPEED", speed + 100)
        assert await param.get_param_float("WPNAV_SPEED") == speed
        with pytest.raises(MissionRawError, match="DENIED"):
            await mission.upload_mission([item(0), item(1)])
        assert not adapter._session.vehicle.state.armed
        assert robot.losses == []


async def test_mavsdk_operates_and_has_taken_the_vehicle_over(free_udp_port):
    async with (
        flown(free_udp_port, may="operate", station=MAVSDK_SYSTEM) as (adapter, robot),
        mavsdk(free_udp_port) as system,
    ):
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        async with asyncio.timeout(LIMIT):
            async for _ in adapter.takeoff(altitude=5.0):
                pass
        assert robot.losses == []
        await action.return_to_launch()
        await robot.until(lambda: bool(robot.losses), LIMIT)
        assert re.fullmatch(r"ground station 245/190 commands it", robot.losses[0])
        await wait_for(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "RETURN_TO_LAUNCH")
        await adapter.stop("hover")
        assert adapter._session.vehicle.flavour.mode_of(adapter._session.vehicle.state) == "BRAKE"


class MavProxy:
    """MAVProxy as a process: commands in, its words out."""

    def __init__(self, process):
        self._process = process

    async def says(self, pattern):
        """Wait for a line."""
        said = []
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LIMIT):
                while line := (await self._process.stdout.readline()).decode(errors="replace"):
                    said.append(line)
                    if re.search(pattern, line):
                        return line
        raise AssertionError(f"MAVProxy never said {pattern!r}: {said}")

    def type(self, command):
        self._process.stdin.write(command.encode() + b"\n")


@contextlib.asynccontextmanager
async def mavproxy(port, folder):
    """Run MAVProxy at a port."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, Path(sys.executable).with_name("mavproxy.py")),
        *(f"--master=udpin:127.0.0.1:{port}", "--default-modules=mode,arm,param,misc,wp,cmdlong"),
        *(f"--state-basedir={folder}", "--aircraft=sim"),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        cwd=folder,
    )
    try:
        yield MavProxy(process)
    finally:
        process.kill()
        await process.communicate()


async def test_mavproxy_reads_all_and_may_not_command(free_udp_port, tmp_path):
    async with flown(free_udp_port) as (adapter, robot), mavproxy(free_udp_port, tmp_path) as station:
        await station.says(f"Saved {len(ardupilot_params(1))} parameters")
        station.type("arm throttle")
        await station.says("COMPONENT_ARM_DISARM: DENIED")
        station.type("mode GUIDED")
        await station.says("DO_SET_MODE: DENIED")
        station.type("wp clear")
        await station.says("refused: may: watch|DENIED")
        assert not adapter._session.vehicle.state.armed
        assert robot.losses == []


async def test_mavproxy_flies_the_vehicle_as_its_operator(free_udp_port, tmp_path):
    async with (
        flown(free_udp_port, may="operate") as (adapter, _),
        mavproxy(free_udp_port, tmp_path) as station,
    ):
        await station.says(f"Saved {len(ardupilot_params(1))} parameters")
        station.type("mode GUIDED")
        await station.says("Mode GUIDED")
        station.type("arm throttle")
        await station.says("^ARMED")
        station.type("takeoff 5")
        await station.says("NAV_TAKEOFF: ACCEPTED")
        assert adapter._session.authority.taker.endswith("commanded by ground station 255/230")
        station.type("mode LAND")
        await station.says("DO_SET_MODE: ACCEPTED")  # it shows the mode later, when the motors may be off
        await station.says("DISARMED")


@contextlib.asynccontextmanager
async def both(folder, ports, *, operates):
    """Show a plane to MAVSDK and to MAVProxy, of which one operates it and the other watches."""
    sdk = {"link": f"udpout:127.0.0.1:{ports[0]}"}
    proxy = {"link": f"udpout:127.0.0.1:{ports[1]}"}
    operator = {"mavsdk": sdk, "mavproxy": proxy}[operates]
    operator |= {"may": "operate", "station": {"mavsdk": 245, "mavproxy": 255}[operates]}
    async with (
        shown("plane", sdk, proxy) as (adapter, robot),
        mavsdk(ports[0]) as system,
        mavproxy(ports[1], folder) as station,
    ):
        await station.says(r"Saved \d+ parameters")
        yield adapter, robot, system, station


def vehicle_mode(adapter):
    """Return the mode that the vehicle shows."""
    vehicle = adapter._session.vehicle
    return vehicle.kind.mode_of(vehicle.state)


async def test_mavproxy_flies_a_plane_while_mavsdk_watches(two_free_udp_ports, tmp_path):
    async with both(tmp_path, two_free_udp_ports, operates="mavproxy") as (adapter, _, system, station):
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        with pytest.raises(ActionError, match="DENIED"):
            await action.arm()
        station.type("mode TAKEOFF")
        await station.says("Mode TAKEOFF")
        station.type("arm throttle")
        await station.says("^ARMED")
        await wait_for(telemetry.subscribe_position(), lambda place: place.relative_altitude_m > 30.0)
        assert adapter._session.authority.taker.endswith("commanded by ground station 255/230")
        with pytest.raises(ActionError):
            await action.return_to_launch()
        assert vehicle_mode(adapter) == "TAKEOFF"
        station.type("mode LOITER")
        await station.says("Mode LOITER")
        await wait_for(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "HOLD")


async def test_mavsdk_takes_a_plane_over_while_mavproxy_watches(two_free_udp_ports, tmp_path):
    async with both(tmp_path, two_free_udp_ports, operates="mavsdk") as (adapter, robot, system, station):
        station.type("mode TAKEOFF")
        await station.says("DO_SET_MODE: DENIED")
        async with asyncio.timeout(LIMIT):
            async for _ in adapter.takeoff(altitude=40.0):
                pass
        await station.says("Mode GUIDED")
        assert robot.losses == []
        station.type("mode MANUAL")
        await station.says("DO_SET_MODE: DENIED")
        await ActionAsync(system).return_to_launch()
        await robot.until(lambda: bool(robot.losses), LIMIT)
        assert robot.losses == ["ground station 245/190 commands it"]
        await station.says("Mode RTL")
        await adapter.stop("hover")
        assert vehicle_mode(adapter) == "LOITER"
