"""The messages that are asked for, and asked for again."""

import asyncio

import pytest

from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavResult
from fleet_mavlink.message_rates import MessageRates, wanted_rates
from fleet_mavlink.messages import Attitude, CommandAck, CommandLong, RequestDataStream


class Vehicle:
    """A vehicle that beats, and answers each request for a message with ``result``."""

    def __init__(self, harness, flavour, *, result=MavResult.ACCEPTED, attitude=True):
        loop = asyncio.get_running_loop()
        self.harness = harness(flavour)
        self.harness.clock.monotonic = self.harness.vehicle.now = loop.time
        self.result = result
        self.attitude = attitude
        self.harness.vehicle._send = self._hear
        self.streams = MessageRates(
            self.harness.vehicle, Commander(self.harness.vehicle, CommandTimeouts()), 10.0
        )

    def _hear(self, message, _address):
        self.harness.sent.append(message)
        if isinstance(message, CommandLong) and self.result is not None:
            ack = CommandAck(message.command, self.result)
            asyncio.get_running_loop().call_later(0.005, self.harness.receive, ack)

    def requested(self, message_id):
        return [each for each in self.harness.sent if getattr(each, "param1", None) == message_id]

    async def live(self, seconds):
        """Beat, and show an attitude, for a while."""
        keeping = asyncio.ensure_future(self.streams.run())
        for _ in range(seconds):
            self.harness.beat(mode=0)
            if self.attitude:
                self.harness.receive(Attitude(int(asyncio.get_running_loop().time() * 1000), 0.0, 0.0, 0.0))
            await asyncio.sleep(1.0)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_every_message_is_asked_for_with_its_interval(run_in_sim_time, harness, flavour):
    async def main():
        vehicle = Vehicle(harness, flavour)
        await vehicle.live(2)
        wanted = wanted_rates(10.0, vehicle.harness.vehicle.flavour)
        requests = {each.param1: each.param2 for each in vehicle.harness.sent}
        assert requests == {float(each): pytest.approx(1e6 / rate) for each, rate in wanted.items()}
        assert {each.command for each in vehicle.harness.sent} == {MavCmd.SET_MESSAGE_INTERVAL}

    run_in_sim_time(main())


def test_what_does_not_come_is_asked_for_again_and_what_comes_is_not(run_in_sim_time, harness):
    async def main():
        vehicle = Vehicle(harness, "px4")
        await vehicle.live(20)
        assert len(vehicle.requested(Attitude.message_id)) == 1
        assert 2 <= len(vehicle.requested(33.0)) <= 4

    run_in_sim_time(main())


def test_what_was_refused_is_not_asked_for_again(run_in_sim_time, harness):
    async def main():
        vehicle = Vehicle(harness, "px4", result=MavResult.DENIED)
        await vehicle.live(40)
        assert len(vehicle.requested(33.0)) == 1

    run_in_sim_time(main())


def test_after_a_reboot_everything_is_asked_for_again(run_in_sim_time, harness):
    async def main():
        vehicle = Vehicle(harness, "ardupilot")
        await vehicle.live(5)
        vehicle.harness.beat(status=1)
        await vehicle.live(5)
        assert len(vehicle.requested(Attitude.message_id)) == 2

    run_in_sim_time(main())


def test_after_a_silence_everything_is_asked_for_again(run_in_sim_time, harness):
    async def main():
        vehicle = Vehicle(harness, "ardupilot")
        keeping = asyncio.ensure_future(vehicle.streams.run())
        vehicle.harness.beat()
        await asyncio.sleep(8)
        assert len(vehicle.requested(Attitude.message_id)) == 1
        vehicle.harness.beat()
        vehicle.harness.beat()
        await asyncio.sleep(2)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)
        assert len(vehicle.requested(Attitude.message_id)) == 2

    run_in_sim_time(main())


@pytest.mark.parametrize(("flavour", "groups"), [("ardupilot", True), ("px4", False)])
def test_old_firmware_is_asked_the_old_way(run_in_sim_time, harness, flavour, groups):
    async def main():
        vehicle = Vehicle(harness, flavour, result=None, attitude=False)
        await vehicle.live(60)
        old = [each for each in vehicle.harness.sent if isinstance(each, RequestDataStream)]
        assert bool(old) is groups
        assert all(each.req_message_rate == 10 for each in old)

    run_in_sim_time(main())


def test_nothing_is_asked_of_a_vehicle_that_is_silent(run_in_sim_time, harness):
    async def main():
        vehicle = Vehicle(harness, "px4")
        keeping = asyncio.ensure_future(vehicle.streams.run())
        await asyncio.sleep(10)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)
        assert vehicle.harness.sent == []

    run_in_sim_time(main())
