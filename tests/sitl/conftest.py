"""A real autopilot by its address, flown in real time."""

import asyncio

import pytest

from fleet.testing.operator import Operator
from fleet.testing.robot import LoopRobot, serve
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


class Sitl(Operator):
    """The adapter on a link to a real autopilot."""

    def __init__(self, link, system_id, speed=None, watchers=()):
        """Take ``speed`` (m/s) as its limit: a plane needs more than the adapter's own."""
        self._limits = MavlinkAdapter.limits.model_copy(update={"speed": speed} if speed else {})
        basics = {"name": "sitl", "twin": TWIN, "adapter": "mavlink", "link": link, "system_id": system_id}
        self._config = MavlinkConfig.model_validate(basics | {"watchers": watchers})

    async def __aenter__(self):
        self.robot = LoopRobot("sitl", self._limits)
        self.adapter = MavlinkAdapter(self._config, self.robot)
        self._run = asyncio.ensure_future(serve(self.adapter))
        return self

    async def __aexit__(self, *_):
        self.robot.close()
        self._run.cancel()
        await asyncio.gather(self._run, return_exceptions=True)

    @property
    def state(self):
        return self.adapter._session.vehicle.state

    async def until(self, holds, within=120.0):
        async with asyncio.timeout(within):
            while not holds():
                if self._run.done():
                    self._run.result()
                await asyncio.sleep(0.05)


@pytest.fixture
def sitl():
    """Make the adapter on a link."""
    return Sitl
