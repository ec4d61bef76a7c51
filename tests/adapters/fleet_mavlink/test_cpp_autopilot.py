"""The adapter against an autopilot that is not ours: mavsdk's server plug-ins, in C++."""

import asyncio
import contextlib
import sys
from pathlib import Path

import pytest

from fleet.clock import SystemClock
from fleet.model.health import Level
from fleet.testing.robot import RecordingRobot, serve
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.constants import MavCmd, MavFrame
from fleet_mavlink.mission_messages import MissionItemInt
from fleet_mavlink.plans import PlanType

AUTOPILOT = Path(__file__).with_name("cpp_autopilot.py")
TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"
ITEMS = tuple(
    MissionItemInt(
        0,
        0,
        0,
        MavFrame.GLOBAL_RELATIVE_ALT_INT,
        MavCmd.NAV_WAYPOINT,
        x=470_000_000 + east,
        y=80_000_000,
        z=9.5,
    )
    for east in range(30)
)


@pytest.fixture
async def flown(free_udp_port):
    """Run the adapter on a link to the C++ autopilot, until the test is over."""
    entry = {
        "name": "kestrel",
        "twin": TWIN,
        "adapter": "mavlink",
        "link": f"udpin:127.0.0.1:{free_udp_port}",
    }
    robot = RecordingRobot(clock=SystemClock(), limits=MavlinkAdapter.limits)
    adapter = MavlinkAdapter(MavlinkConfig.model_validate(entry), robot)
    running = asyncio.ensure_future(serve(adapter))
    autopilot = await asyncio.create_subprocess_exec(
        sys.executable, str(AUTOPILOT), str(free_udp_port), stdout=asyncio.subprocess.DEVNULL
    )
    yield adapter, robot
    autopilot.kill()
    await autopilot.wait()
    running.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await running


@pytest.mark.real_time
async def test_fail_safes_arming_and_plans_work_with_an_autopilot_that_is_not_ours(flown):
    adapter, robot = flown
    await robot.until(lambda: any("NAV_DLL_ACT is 0" in health.cause for health in robot.healths), 30)
    await adapter.set_failsafes()
    assert robot.healths[-1].level is Level.OK
    await adapter.arm()
    assert adapter._session.vehicle.state.armed
    await adapter.disarm()
    assert not adapter._session.vehicle.state.armed
    plans = adapter._session.plans
    await plans.upload(PlanType.MISSION, ITEMS)
    kept = await plans.download(PlanType.MISSION)
    assert [(item.x, item.z, item.command) for item in kept] == [
        (item.x, item.z, item.command) for item in ITEMS
    ]
    await plans.clear(PlanType.MISSION)
