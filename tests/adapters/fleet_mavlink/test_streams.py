"""The messages that are asked for, and asked for again."""

import asyncio

import pytest

from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavResult
from fleet_mavlink.messages import Attitude, CommandAck, CommandLong, RequestDataStream
from fleet_mavlink.streams import Streams, wanted_rates


class Vehicle:
    """A vehicle that beats, and answers each request for a message with ``result``."""

    def __init__(self, told, flavour, *, result=MavResult.ACCEPTED, attitude=True):
        loop = asyncio.get_running_loop()
        self.told = told(flavour)
        self.told.clock.monotonic = self.told.vehicle.now = loop.time
        self.result = result
        self.attitude = attitude
        self.told.vehicle._send = self._hear
        self.streams = Streams(self.told.vehicle, Commander(self.told.vehicle, CommandTimeouts()), 10.0)

    def _hear(self, message, _address):
        self.told.sent.append(message)
        if isinstance(message, CommandLong) and self.result is not None:
            ack = CommandAck(message.command, self.result)
            asyncio.get_running_loop().call_later(0.005, self.told.say, ack)

    def asked(self, message_id):
        return [each for each in self.told.sent if getattr(each, "param1", None) == message_id]

    async def live(self, seconds):
        """Beat, and show an attitude, for a while."""
        keeping = asyncio.ensure_future(self.streams.keep())
        for _ in range(seconds):
            self.told.beat(mode=0)
            if self.attitude:
                self.told.say(Attitude(int(asyncio.get_running_loop().time() * 1000), 0.0, 0.0, 0.0))
            await asyncio.sleep(1.0)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_every_message_is_asked_for_with_its_interval(fly, told, flavour):
    async def main():
        vehicle = Vehicle(told, flavour)
        await vehicle.live(2)
        wanted = wanted_rates(10.0, vehicle.told.vehicle.flavour)
        asks = {each.param1: each.param2 for each in vehicle.told.sent}
        assert asks == {float(each): pytest.approx(1e6 / rate) for each, rate in wanted.items()}
        assert {each.command for each in vehicle.told.sent} == {MavCmd.SET_MESSAGE_INTERVAL}

    fly(main())


def test_what_does_not_come_is_asked_for_again_and_what_comes_is_not(fly, told):
    async def main():
        vehicle = Vehicle(told, "px4")
        await vehicle.live(20)
        assert len(vehicle.asked(Attitude.message_id)) == 1
        assert 2 <= len(vehicle.asked(33.0)) <= 4

    fly(main())


def test_what_was_refused_is_not_asked_for_again(fly, told):
    async def main():
        vehicle = Vehicle(told, "px4", result=MavResult.DENIED)
        await vehicle.live(40)
        assert len(vehicle.asked(33.0)) == 1

    fly(main())


def test_after_a_reboot_everything_is_asked_for_again(fly, told):
    async def main():
        vehicle = Vehicle(told, "ardupilot")
        await vehicle.live(5)
        vehicle.told.beat(status=1)
        await vehicle.live(5)
        assert len(vehicle.asked(Attitude.message_id)) == 2

    fly(main())


def test_after_a_silence_everything_is_asked_for_again(fly, told):
    async def main():
        vehicle = Vehicle(told, "ardupilot")
        keeping = asyncio.ensure_future(vehicle.streams.keep())
        vehicle.told.beat()
        await asyncio.sleep(8)
        assert len(vehicle.asked(Attitude.message_id)) == 1
        vehicle.told.beat()
        vehicle.told.beat()
        await asyncio.sleep(2)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)
        assert len(vehicle.asked(Attitude.message_id)) == 2

    fly(main())


@pytest.mark.parametrize(("flavour", "groups"), [("ardupilot", True), ("px4", False)])
def test_old_firmware_is_asked_the_old_way(fly, told, flavour, groups):
    async def main():
        vehicle = Vehicle(told, flavour, result=None, attitude=False)
        await vehicle.live(60)
        old = [each for each in vehicle.told.sent if isinstance(each, RequestDataStream)]
        assert bool(old) is groups
        assert all(each.req_message_rate == 10 for each in old)

    fly(main())


def test_nothing_is_asked_of_a_vehicle_that_is_silent(fly, told):
    async def main():
        vehicle = Vehicle(told, "px4")
        keeping = asyncio.ensure_future(vehicle.streams.keep())
        await asyncio.sleep(10)
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)
        assert vehicle.told.sent == []

    fly(main())
