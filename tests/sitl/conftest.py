"""A real autopilot by its address, flown in real time."""

import asyncio
import contextlib
import logging

import pytest

from fleet.clock import SystemClock
from fleet.commands import arguments
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


class Host:
    """The host's side of one run, in real time."""

    name = "sitl"

    def __init__(self):
        self.clock = SystemClock()
        self.log = logging.getLogger("fleet.robot.sitl")
        self.reports, self.healths, self.losses = [], [], []
        self._timers = {}

    def report(self, report):
        self.reports.append(report)

    def health(self, health):
        self.healths.append(health)

    def authority_lost(self, reason):
        self.losses.append(reason)

    def every(self, seconds, call):
        loop = asyncio.get_running_loop()

        def again():
            self._timers[call] = loop.call_later(seconds, again)
            call()

        self._timers[call] = loop.call_later(seconds, again)

    def share(self, key, make):
        return make()

    def close(self):
        for timer in self._timers.values():
            timer.cancel()


class Sitl:
    """The adapter on a link to a real autopilot."""

    def __init__(self, link, system_id):
        basics = {"name": "sitl", "twin": TWIN, "adapter": "mavlink", "link": link, "system_id": system_id}
        self.adapter = MavlinkAdapter(MavlinkConfig.model_validate(basics))
        self.robot = Host()

    async def __aenter__(self):
        self._run = asyncio.ensure_future(self.adapter.run(self.robot))
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

    async def do(self, name, /, **data):
        spec = self.adapter.commands()[name]
        doing = getattr(self.adapter, spec.method)(**arguments(spec, data))
        async with asyncio.timeout(spec.timeout):
            if not spec.streams:
                return await doing
            async with contextlib.aclosing(doing):
                return [progress.percent async for progress in doing]

    async def drive(self, velocity, seconds):
        for _ in range(round(seconds * 10)):
            self.adapter.drive(velocity)
            await asyncio.sleep(0.1)


@pytest.fixture
def sitl():
    """Make the adapter on a link."""
    return Sitl
