"""One vehicle over several links: the first that carries it is used, lost ones come back by themselves."""

import asyncio

import pytest
from pydantic import ValidationError

from fleet import LinkLost
from fleet.link.memory import MemoryRobot
from fleet.model.health import Level
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.redundant_links import open_links


@pytest.fixture
def two_links(sim_flight):
    """Make a flight whose vehicle also speaks over a second link; ``cut`` says which of them are down."""

    class TwoLinks(sim_flight):
        def __init__(self, flavour, **config):
            super().__init__(flavour, backup_links=[f"memory:{id(self)}-backup"], **config)
            self.cut = set()
            self.spoken = []
            self._backup = MemoryRobot(f"{id(self)}-backup", lambda data: self._by("backup", data))
            self._peer._answer = lambda data: self._by("main", data)
            self._say = self._peer.say
            self._peer.say = self._tell

        def _by(self, index, data):
            if index in self.cut:
                return b""
            self.spoken.append(index)
            return self._heard(data)

        def _tell(self, data):
            if "main" not in self.cut:
                self._say(data)
            if "backup" not in self.cut:
                self._backup.say(data)

        async def __aenter__(self):
            self._backup.__enter__()
            return await super().__aenter__()

        async def __aexit__(self, *_):
            await super().__aexit__(*_)
            self._backup.__exit__(None, None, None)

    return TwoLinks


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_flight_goes_on_over_the_second_link(run_in_sim_time, two_links, flavour):
    async def main():
        async with two_links(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            assert all(health.level is Level.OK for health in it.robot.healths[1:])
            it.cut.add("main")
            await it.until(lambda: it.adapter._session.vehicle.switches == 1, within=4.0)
            await it.do("land")
            assert not it.armed
            assert it.robot.losses == []
            it.cut.clear()
            await it.until(lambda: it.adapter._session.vehicle.switches == 2, within=4.0)
            assert all(health.level is Level.OK for health in it.robot.healths[1:])

    run_in_sim_time(main())


def test_what_comes_by_both_is_believed_once_and_no_alarm(run_in_sim_time, two_links):
    async def main():
        async with two_links("px4") as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            vehicle = it.adapter._session.vehicle
            assert not vehicle.clashing
            assert len(it.requested(MavCmd.NAV_TAKEOFF)) == 1
            assert vehicle.trust.counts["messages of a second vehicle with this id"] == 0

    run_in_sim_time(main())


def test_rates_are_asked_for_again_on_the_other_link(run_in_sim_time, two_links):
    async def main():
        async with two_links("ardupilot") as it:
            await it.wait_until_known()
            await asyncio.sleep(3.0)
            before = len(it.requested(MavCmd.SET_MESSAGE_INTERVAL))
            it.cut.add("main")
            await it.until(lambda: len(it.requested(MavCmd.SET_MESSAGE_INTERVAL)) >= before + 8, within=8.0)

    run_in_sim_time(main())


def test_a_link_that_falls_is_opened_again_by_itself(run_in_sim_time, two_links):
    async def main():
        async with two_links("px4") as it:
            await it.wait_until_known()
            it._peer.unplug()
            await it.until(lambda: it._peer.opened == 2, within=3.0)
            assert not it.run.done()
            del it.spoken[:]
            await asyncio.sleep(3.0)
            assert {"main", "backup"} <= set(it.spoken)  # its heartbeat goes out on both

    run_in_sim_time(main())


async def test_links_of_which_none_opens_are_lost(monkeypatch):
    monkeypatch.setattr("fleet_mavlink.redundant_links._FIRST_WITHIN", 0.05)
    with pytest.raises(LinkLost, match="none of them"):
        await open_links(["memory:nobody-1", "memory:nobody-2"], lambda *_: None)


def test_a_simulator_is_no_second_way():
    basics = {"name": "k", "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", "adapter": "mavlink"}
    with pytest.raises(ValidationError, match="cannot be a backup link"):
        MavlinkConfig.model_validate({**basics, "link": "udpin:0.0.0.0:1", "backup_links": ["sim:px4"]})
