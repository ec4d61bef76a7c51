"""Clients that were written by others fly the simulated vehicles: MAVSDK (C++) and MAVProxy."""

import asyncio
import json
import math
import re
import sys
from pathlib import Path

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.action import ActionError
from mavsdk.plugins.mavlink_direct import MavlinkMessage
from mavsdk.plugins.mission import MissionItem, MissionPlan
from mavsdk.plugins.offboard import OffboardError, VelocityBodyYawspeed

from fleet.sim.process import SimProcess
from fleet_mavlink.sim.params import ardupilot_params, px4_params
from fleet_mavlink.sim.spec import VehicleSpec

SPEED = 5.0
LIMIT = 40  # seconds for one wait, on a busy computer
FLAVOURS = ("ardupilot", "px4")
ARDUPILOT_NEEDS = (1, 2, 24, 33, 42, 242, 245)  # messages that ArduPilot sends only when asked


async def wait_for(stream, happened):
    """Return the first value of a subscription for which something is true."""
    async with asyncio.timeout(LIMIT):
        async for value in stream:
            if happened(value):
                return value
    raise AssertionError("the subscription ended")


async def retry_until_accepted(act, error):
    """Ask until it is granted: ArduPilot needs its position in GUIDED, which takes a while."""
    async with asyncio.timeout(LIMIT):
        while True:
            try:
                return await act()
            except error:
                await asyncio.sleep(0.1)


@pytest.fixture(params=FLAVOURS)
async def drone(request):
    """Connect MAVSDK to a vehicle."""
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    spec = VehicleSpec.parse(f"sim:{request.param}?speed={SPEED}")
    async with (
        SimProcess("fleet_mavlink.sim") as simulator,
        simulator.robot(spec) as link,
        Mavsdk(configuration) as mavsdk,
    ):
        await mavsdk.add_any_connection(f"udpout://127.0.0.1:{link.rpartition(':')[2]}")
        system = await mavsdk.first_autopilot(timeout_s=LIMIT)
        assert system is not None
        if request.param == "ardupilot":
            await request_for_messages(system)
        yield Drone(request.param, system)


class Drone:
    """The plugins of MAVSDK that the tests use."""

    def __init__(self, flavour, system):
        self.flavour = flavour
        self.action = ActionAsync(system)
        self.telemetry = TelemetryAsync(system)
        self.offboard = OffboardAsync(system)
        self.param = ParamAsync(system)
        self.mission = MissionAsync(system)
        self.mission_raw = MissionRawAsync(system)

    async def healthy(self):
        return await wait_for(
            self.telemetry.subscribe_health(),
            lambda health: health.is_armable and health.is_home_position_ok and health.is_global_position_ok,
        )

    async def climb(self, height):
        """Take off and return the place above which the vehicle is."""
        await self.healthy()
        await self.action.set_takeoff_altitude(height)
        if self.flavour == "ardupilot":
            with pytest.raises(ActionError):
                await self.action.takeoff()  # refused without armed motors, and leaves GUIDED set
        await retry_until_accepted(self.action.arm, ActionError)
        await self.action.takeoff()
        return await wait_for(
            self.telemetry.subscribe_position(), lambda place: place.relative_altitude_m > height - 0.5
        )

    async def come_down(self):
        await self.action.land()
        await wait_for(self.telemetry.subscribe_armed(), lambda armed: not armed)


async def request_for_messages(system):
    direct = MavlinkDirectAsync(system)
    for message_id in ARDUPILOT_NEEDS:
        fields = {
            "target_system": 1,
            "target_component": 1,
            "command": 511,
            "confirmation": 0,
            "param1": message_id,
            "param2": 1e5,
            **{f"param{number}": 0 for number in range(3, 8)},
        }
        await direct.send_message(MavlinkMessage("COMMAND_LONG", 245, 190, 1, 1, json.dumps(fields)))


async def test_mavsdk_takes_off_goes_somewhere_and_lands(drone):
    here = await drone.climb(6.0)
    await wait_for(drone.telemetry.subscribe_in_air(), lambda in_air: in_air)
    north = here.latitude_deg + 0.0002
    await drone.action.goto_location(north, here.longitude_deg, here.absolute_altitude_m + 2, 0.0)
    await wait_for(
        drone.telemetry.subscribe_position(),
        lambda place: abs(place.latitude_deg - north) < 5e-6 and place.relative_altitude_m > 7,
    )
    await drone.come_down()


async def test_mavsdk_drives_by_velocity(drone):
    here = await drone.climb(5.0)
    await drone.offboard.set_velocity_body(VelocityBodyYawspeed(2.0, 0.0, 0.0, 0.0))
    await retry_until_accepted(drone.offboard.start, OffboardError)
    await wait_for(
        drone.telemetry.subscribe_position(), lambda place: place.latitude_deg - here.latitude_deg > 5e-5
    )
    await drone.offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
    await wait_for(
        drone.telemetry.subscribe_velocity_ned(),
        lambda speed: math.hypot(speed.north_m_s, speed.east_m_s) < 0.1,
    )
    await drone.offboard.stop()
    await drone.come_down()


async def test_mavsdk_reads_and_writes_parameters(drone):
    real, whole = {"ardupilot": ("WPNAV_SPEED", "RTL_ALT"), "px4": ("MPC_XY_CRUISE", "COM_DL_LOSS_T")}[
        drone.flavour
    ]
    await drone.param.set_param_float(real, 4.5)
    await drone.param.set_param_int(whole, 1234)
    assert await drone.param.get_param_float(real) == 4.5
    assert await drone.param.get_param_int(whole) == 1234
    everything = await drone.param.get_all_params()
    known = {"ardupilot": ardupilot_params, "px4": px4_params}[drone.flavour](1)
    assert len(everything.float_params) + len(everything.int_params) == len(known)


async def test_mavsdk_uploads_and_flies_a_mission(drone):
    here = await drone.climb(5.0)
    nan = math.nan
    places = [(here.latitude_deg + step * 1e-4, here.longitude_deg + 1e-4) for step in range(3)]
    items = [
        MissionItem(
            *place, 8.0, 5.0, True, *(nan, nan, 0, nan, nan), acceptance_radius_m=1.0, yaw_deg=nan,
            camera_photo_distance_m=nan,
        )
        for place in places
    ]  # fmt: skip
    await drone.mission.upload_mission(MissionPlan(items))
    downloaded = await drone.mission_raw.download_mission()
    assert [item.x for item in downloaded if item.command == 16][-3:] == pytest.approx(
        [int(latitude * 1e7) for latitude, _ in places], abs=2
    )
    await drone.mission.start_mission()
    await wait_for(
        drone.mission.subscribe_mission_progress(), lambda progress: progress.current == progress.total == 3
    )
    assert await drone.mission.is_mission_finished()
    await drone.come_down()


class MavProxy:
    """MAVProxy as a process: commands in, its words out."""

    def __init__(self, process):
        self._process = process

    async def says(self, pattern):
        """Wait for a line."""
        said = []
        try:
            async with asyncio.timeout(LIMIT):
                while line := (await self._process.stdout.readline()).decode():
                    said.append(line)
                    if re.search(pattern, line):
                        return line
        except TimeoutError:
            pass
        raise AssertionError(f"MAVProxy never said {pattern!r}: {said}")

    def type(self, command):
        self._process.stdin.write(command.encode() + b"\n")

    async def shows(self, command, pattern):
        """Repeat a question until the answer is as wanted."""
        async with asyncio.timeout(LIMIT):
            while True:
                self.type(command)
                line = (await self._process.stdout.readline()).decode()
                if re.search(pattern, line):
                    return
                await asyncio.sleep(0.1)


@pytest.fixture
async def mavproxy(tmp_path):
    simulator = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "fleet_mavlink.sim", "--tcp", "0", "--flavour", "ardupilot"),
        *("--ready-after", "3", "--speed", "3"),
        stdout=asyncio.subprocess.PIPE,
    )
    url = json.loads(await simulator.stdout.readline())["url"]
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, Path(sys.executable).with_name("mavproxy.py")),
        *(f"--master={url}", "--default-modules=mode,arm,param,misc,wp,cmdlong"),
        *(f"--state-basedir={tmp_path}", "--aircraft=sim"),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        cwd=tmp_path,
    )
    yield MavProxy(process)
    process.kill()
    simulator.terminate()
    await process.communicate()
    await simulator.communicate()


async def test_mavproxy_flies_ardupilot(mavproxy):
    await mavproxy.says(f"Saved {len(ardupilot_params(1))} parameters")
    mavproxy.type("mode GUIDED")
    await mavproxy.says("Mode GUIDED")
    mavproxy.type("arm throttle")
    await mavproxy.says("^ARMED")
    mavproxy.type("takeoff 5")
    await mavproxy.says("NAV_TAKEOFF: ACCEPTED")
    mavproxy.type("param set WPNAV_SPEED 300")
    await mavproxy.shows("param show WPNAV_SPEED", r"WPNAV_SPEED\s+300")
    mavproxy.type("mode LAND")
    await mavproxy.says("DO_SET_MODE: ACCEPTED")  # it shows the mode later, when the motors may be off
    await mavproxy.says("DISARMED")
