"""The adapter on a real device file: cables pulled and put back, two openers, a killed worker."""

import asyncio
import contextlib
import os
import sys
import uuid

import pytest

from fleet import Level, LinkLost, LinkRefused, PoseReport, Vector3, Velocity, open_link
from fleet.host.robot.adapter_factory import create_adapter
from fleet.testing.robot import RecordingRobot
from fleet.testing.robot import serve as serve_adapter
from fleet_ugv import UgvAdapter
from fleet_ugv.sim.server import Bases
from fleet_ugv.sim.spec import BaseSpec

FORWARD = Velocity(Vector3(0.3))
WITHIN = 60.0  # s
DRIVER = """
import asyncio, sys
from fleet import Vector3, Velocity
from fleet.errors import NotReady
from fleet.host.robot.adapter_factory import create_adapter
from fleet.testing.robot import RecordingRobot, serve
from fleet_ugv import UgvAdapter, UgvConfig

async def drive(url, profile):
    config = UgvConfig(name="beast", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", adapter="ugv",
                       profile=profile, link=url)
    robot = RecordingRobot()
    adapter = create_adapter(UgvAdapter, config, robot)
    run = asyncio.create_task(serve(adapter))
    while not run.done():
        await asyncio.sleep(0.02)
        robot.advance(0.02)
        try:
            if robot.is_connected:
                adapter.drive(Velocity(Vector3(0.3)))
        except NotReady:
            pass

asyncio.run(drive(*sys.argv[1:]))
"""


@pytest.fixture
async def server(tmp_path):
    server = Bases(tmp_path)
    life = asyncio.create_task(server.run())
    yield server
    life.cancel()
    await asyncio.gather(life, return_exceptions=True)


@pytest.fixture
async def serve(make_config):
    """Run an adapter on a link until the test ends; returns its robot, the adapter and its run."""
    tasks = []

    def start(profile, url):
        robot = RecordingRobot()
        adapter = create_adapter(UgvAdapter, make_config(profile, url, twin=str(uuid.uuid4())), robot)
        run = asyncio.create_task(serve_adapter(adapter))
        tasks.extend([run, asyncio.create_task(turn(robot, run))])
        return robot, adapter, run

    yield start
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def turn(robot, run):
    """Turn the robot's wheel in real time; what a call raises ends its run."""
    while not run.done():
        await asyncio.sleep(0.02)
        try:
            robot.advance(0.02)
        except LinkLost:
            run.cancel()


async def until(condition):
    async with asyncio.timeout(WITHIN):
        while not condition():  # noqa: ASYNC110 - the simulator sets no event
            await asyncio.sleep(0.01)


def place_of(robot):
    """Return where the robot last said that it is."""
    return robot.reports_of(PoseReport)[-1].position


def is_ok(robot):
    return bool(robot.healths) and robot.healths[-1].level is Level.OK


@pytest.mark.parametrize("profile", ["waveshare-beast", "ros-arduino", "hoverboard"])
async def test_every_base_drives_over_its_device(server, serve, profile):
    port = await server.add(BaseSpec(profile))
    robot, adapter, _ = serve(profile, port.url)
    await until(lambda: is_ok(robot))
    adapter.drive(FORWARD)
    await until(lambda: port.board.physics.x > 0.1)
    adapter.halt()
    await until(lambda: port.board.physics.speeds == [0.0, 0.0])
    await until(lambda: place_of(robot).x > 0.05)


async def test_a_pulled_cable_is_noticed_at_once_and_the_base_stops_by_itself(server, serve):
    port = await server.add(BaseSpec("waveshare-beast"))
    robot, adapter, run = serve("waveshare-beast", port.url)
    await until(lambda: is_ok(robot))
    adapter.drive(FORWARD)
    await until(lambda: port.board.physics.speeds[0] > 0.1)
    port.unplug()
    await until(run.done)
    assert isinstance(run.exception(), LinkLost)
    await until(lambda: port.board.physics.speeds == [0.0, 0.0])


async def test_a_cable_that_is_put_back_is_found_under_its_name(server, serve):
    port = await server.add(BaseSpec("waveshare-beast"))
    port.unplug()
    with pytest.raises(LinkLost, match="plugged in"):
        await open_link(port.url, lambda *_: None)
    port.plug()
    robot, _, _ = serve("waveshare-beast", port.url)
    await until(lambda: is_ok(robot))


async def test_a_device_that_another_program_holds_is_refused(server, serve):
    port = await server.add(BaseSpec("waveshare-beast"))
    robot, _, _ = serve("waveshare-beast", port.url)
    await until(lambda: is_ok(robot))
    with pytest.raises(LinkRefused, match="another program"):
        await open_link(port.url, lambda *_: None)


@pytest.mark.parametrize("profile", ["waveshare-beast", "ros-arduino", "hoverboard"])
async def test_when_the_worker_is_killed_the_base_stops_within_its_own_time(server, profile):
    port = await server.add(BaseSpec(profile))
    worker = await asyncio.create_subprocess_exec(sys.executable, "-c", DRIVER, port.url, profile)
    try:
        await until(lambda: port.board.physics.speeds[0] > 0.1)
    finally:
        worker.kill()
        await worker.wait()
    killed = port.now()
    await until(lambda: port.board.physics.wanted == [0.0, 0.0])
    assert port.board.halted_at is not None
    assert port.board.halted_at - killed <= port.board.timeout + 0.1


async def test_a_megabyte_without_an_end_costs_no_link(server, serve):
    port = await server.add(BaseSpec("waveshare-beast"))
    robot, _, _ = serve("waveshare-beast", port.url)
    await until(lambda: is_ok(robot))
    left = 1 << 20
    while left:
        with contextlib.suppress(BlockingIOError):
            left -= os.write(port._master, b"x" * min(left, 4096))
        await asyncio.sleep(0)
    os.write(port._master, b"\n")
    robot.healths.clear()
    await until(lambda: is_ok(robot))
