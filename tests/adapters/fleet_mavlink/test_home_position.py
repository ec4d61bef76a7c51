"""Home of a vehicle: set here or to a place, and believed only once the vehicle reports it."""

import asyncio
import contextlib

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import NotReady, Refused, TimedOut
from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavFrame, MavResult
from fleet_mavlink.home_position import VehicleHome
from fleet_mavlink.messages import (
    Attitude,
    CommandAck,
    CommandInt,
    EkfStatusReport,
    ExtendedSysState,
    GlobalPositionInt,
    HomePosition,
)

HERE = (47.3977421, 8.5455941)
GROUND, AIR = mav.MAV_LANDED_STATE_ON_GROUND, mav.MAV_LANDED_STATE_IN_AIR
UNKNOWN = mav.MAV_LANDED_STATE_UNDEFINED
AMSL, ABOVE_HOME = 503.0, 15.0
DEGREES_PER_METRE = 1 / 111_320


def scaled(degrees):
    return round(degrees * 1e7)


class Autopilot:
    """A vehicle that beats and tells its position, and makes home what it is told, ``offset`` m north."""

    def __init__(self, it, landed):
        self.it, self.landed, self.offset = it, landed, 0.0
        self.home, self.silent = (*HERE, AMSL - ABOVE_HOME), False
        self.armed, self.result, self.tells_home, self.tells_height, self.flags = (
            landed == AIR,
            MavResult.ACCEPTED,
            True,
            True,
            0x33,
        )

    @property
    def commands(self):
        return [each for each in self.it.sent if isinstance(each, CommandInt)]

    async def run(self):
        done = 0
        while not self.silent:
            self.it.beat(armed=self.armed)
            self.it.receive(ExtendedSysState(self.landed), EkfStatusReport(self.flags), Attitude(1, 0, 0, 0))
            if self.tells_height:
                place = scaled(HERE[0]), scaled(HERE[1]), round(AMSL * 1e3), round(ABOVE_HOME * 1e3)
                self.it.receive(GlobalPositionInt(1, *place, 0, 0, 0, 0))
            for command in self.commands[done:]:
                done += 1
                self.it.receive(CommandAck(command.command, self.result))
                north = self.offset * DEGREES_PER_METRE
                self.home = (command.x / 1e7 + north, command.y / 1e7, command.z)
            if self.tells_home:
                latitude, longitude, altitude = self.home
                self.it.receive(HomePosition(scaled(latitude), scaled(longitude), round(altitude * 1e3)))
            await asyncio.sleep(0.1)


@pytest.fixture
def at_home(run_in_sim_time, harness):
    """Run a test with the home of a vehicle, and its autopilot."""

    def at_home(test, landed=GROUND, **autopilot):
        async def main():
            it = harness("ardupilot").in_loop()
            other = Autopilot(it, landed)
            for name, value in autopilot.items():
                setattr(other, name, value)
            running = asyncio.ensure_future(other.run())
            await asyncio.sleep(0.2)
            home = VehicleHome(it.vehicle, Commander(it.vehicle, CommandTimeouts()))
            await test(home, other)
            running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await running

        run_in_sim_time(main())

    return at_home


def test_its_altitude_is_what_its_heights_are_measured_from(at_home):
    async def test(home, autopilot):
        assert await home.altitude() == pytest.approx(AMSL - ABOVE_HOME)

    at_home(test)


def test_an_altitude_that_is_not_known_yet_is_waited_for_three_seconds(at_home):
    async def test(home, autopilot):
        loop = asyncio.get_running_loop()
        began = loop.time()
        with pytest.raises(NotReady, match="home is unknown") as caught:
            await home.altitude()
        assert loop.time() - began == pytest.approx(3.0, abs=0.01)
        assert caught.value.hint == "wait for a position"
        loop.call_later(2.0, setattr, autopilot, "tells_height", True)
        assert await home.altitude() == pytest.approx(AMSL - ABOVE_HOME)

    at_home(test, tells_height=False)


def test_on_the_ground_its_own_place_becomes_home(at_home):
    async def test(home, autopilot):
        await home.set_here()
        (command,) = autopilot.commands
        assert (command.command, command.frame) == (MavCmd.DO_SET_HOME, MavFrame.GLOBAL)
        assert (command.x, command.y, command.z) == (scaled(HERE[0]), scaled(HERE[1]), AMSL)
        assert command.param1 == 0.0, "1 would be its present place, whatever the rest says"

    at_home(test)


def test_in_the_air_its_place_becomes_home_at_the_altitude_of_the_home_before(at_home):
    async def test(home, autopilot):
        await home.set_here()
        (command,) = autopilot.commands
        assert command.z == pytest.approx(AMSL - ABOVE_HOME)

    at_home(test, landed=AIR)


def test_a_vehicle_that_is_armed_and_does_not_say_whether_it_flies_counts_as_in_the_air(at_home):
    async def test(home, autopilot):
        await home.set_here()
        assert autopilot.commands[0].z == pytest.approx(AMSL - ABOVE_HOME)
        with pytest.raises(Refused, match="in the air home keeps its altitude"):
            await home.set_to(47.398, 8.546, AMSL)

    at_home(test, landed=UNKNOWN, armed=True)


def test_a_disarmed_vehicle_that_does_not_say_whether_it_flies_counts_as_on_the_ground(at_home):
    async def test(home, autopilot):
        await home.set_here()
        assert autopilot.commands[0].z == AMSL

    at_home(test, landed=UNKNOWN)


def test_an_unreliable_place_does_not_become_home(at_home):
    async def test(home, autopilot):
        with pytest.raises(NotReady, match="position is unknown"):
            await home.set_here()
        assert autopilot.commands == []

    at_home(test, flags=0x0F)
    at_home(test, tells_height=False)


def test_home_is_set_to_a_place_in_degrees_and_metres(at_home):
    async def test(home, autopilot):
        await home.set_to(-33.8567844, -151.2152967, 12.5)
        (command,) = autopilot.commands
        assert (command.x, command.y, command.z) == (-338567844, -1512152967, 12.5)

    at_home(test)


def test_without_an_altitude_home_keeps_its_own(at_home):
    async def test(home, autopilot):
        await home.set_to(47.398, 8.546, None)
        assert autopilot.commands[0].z == pytest.approx(AMSL - ABOVE_HOME)

    at_home(test)
    at_home(test, landed=AIR)


def test_in_the_air_no_other_altitude_is_taken(at_home):
    async def test(home, autopilot):
        with pytest.raises(Refused, match="in the air home keeps its altitude") as caught:
            await home.set_to(47.398, 8.546, AMSL - ABOVE_HOME)
        assert caught.value.hint == "leave the altitude out"
        assert autopilot.commands == []

    at_home(test, landed=AIR)


NO_PLACE = "home must be a place on Earth, in degrees and metres"


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ((90.0, 8.0, 5.0), NO_PLACE),
        ((-90.0, 8.0, 5.0), NO_PLACE),
        ((47.0, 180.1, 5.0), NO_PLACE),
        ((47.0, -180.1, 5.0), NO_PLACE),
        ((float("nan"), 8.0, 5.0), NO_PLACE),
        ((47.0, float("nan"), None), NO_PLACE),
        ((47.0, 8.0, float("inf")), NO_PLACE),
        ((47.0, 8.0, float("nan")), NO_PLACE),
        ((47.0, 8.0, 9000.5), "9000.5 m above mean sea level is no altitude of a home"),
        ((47.0, 8.0, -500.5), "-500.5 m above mean sea level is no altitude of a home"),
    ],
)
def test_what_is_no_home_is_refused_before_anything_is_sent(at_home, place, why):
    async def test(home, autopilot):
        with pytest.raises(Refused) as caught:
            await home.set_to(*place)
        assert caught.value.reason == why
        assert autopilot.commands == []

    at_home(test)


@pytest.mark.parametrize("place", [(89.9, 180.0, 9000.0), (-89.9, -180.0, -500.0), (0.5, 0.5, 0.0)])
def test_any_place_on_earth_may_be_home(at_home, place):
    async def test(home, autopilot):
        await home.set_to(*place)
        assert len(autopilot.commands) == 1

    at_home(test)


@pytest.mark.parametrize(("offset", "taken"), [(1.8, True), (2.2, False)])
def test_a_home_that_is_reported_elsewhere_is_not_set(at_home, offset, taken):
    async def test(home, autopilot):
        began = asyncio.get_running_loop().time()
        if taken:
            await home.set_to(47.398, 8.546, 490.0)
        else:
            with pytest.raises(TimedOut, match="it accepted the command but reports another home position"):
                await home.set_to(47.398, 8.546, 490.0)
            assert asyncio.get_running_loop().time() - began == pytest.approx(4.0, abs=0.3)

    at_home(test, offset=offset)


def test_an_autopilot_that_refuses_is_quoted(at_home):
    async def test(home, autopilot):
        with pytest.raises(Refused, match="DENIED to DO_SET_HOME"):
            await home.set_to(47.398, 8.546, 490.0)

    at_home(test, result=MavResult.DENIED)


def test_a_silent_vehicle_is_told_nothing(at_home):
    async def test(home, autopilot):
        autopilot.silent = True
        await asyncio.sleep(4.0)
        for setting in (home.set_here(), home.set_to(47.0, 8.0, None)):
            with pytest.raises(NotReady, match="no heartbeat from system 1"):
                await setting
        assert autopilot.commands == []

    at_home(test)
