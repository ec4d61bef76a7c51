"""The take-off of a plane: to the end of the autopilot's own, then in a circle to its height."""

import asyncio
import math
from types import SimpleNamespace

import msgspec
import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import NotReady, Refused, TimedOut
from fleet_mavlink.ardupilot_plane import ArduPlane
from fleet_mavlink.messages import ExtendedSysState, GlobalPositionInt
from fleet_mavlink.px4_plane import Px4Plane
from fleet_mavlink.winged_takeoff import WingedTakeOff

HOME = 488.0  # m AMSL
PLACE = 473977421, 85455941
GROUND, AIR = mav.MAV_LANDED_STATE_ON_GROUND, mav.MAV_LANDED_STATE_IN_AIR
SPEEDS = {"ardupilot": (10.0, 15.0, 22.0), "px4": (10.0, 15.0, 20.0)}
PLANES = {"ardupilot": ArduPlane, "px4": Px4Plane}
both = pytest.mark.parametrize("flavour", PLANES)


class Flight:
    """A flight that notes what is asked of it, and moves the vehicle as a test says."""

    def __init__(self, it, fastest=30.0):
        self.vehicle, self.fastest, self.log, self.checked = it.vehicle, fastest, [], []
        self.refusal, self._it = None, it
        self.arming = SimpleNamespace(arm=self._noted("arm"), disarm_quietly=self._noted("disarm"))
        self.home = SimpleNamespace(altitude=self._altitude)

    def _noted(self, what):
        async def note():
            self.log.append(what)

        return note

    async def _altitude(self):
        return HOME

    def end_stream(self, flavour, mode):
        self.log.append(f"end the stream for {mode}")

    async def enter(self, mode, request):
        self.log.append((mode, request.command, request.param7))

    async def go(self, to, speed, heading):
        assert math.isnan(heading), "the autopilot's own"
        self.gone_at = self.vehicle.state.relative_altitude
        self.log.append(("go", to.latitude, to.longitude, to.altitude, speed))

    def mode(self, state):
        return self.shown

    def check(self, *modes):
        self.checked.append(modes)
        if self.refusal:
            raise self.refusal

    shown = ""


class Plane:
    """A plane of a test, and its take-off."""

    def __init__(self, it, flavour, *, settings=()):
        self.it, self.flavour, self.flight = it, PLANES[flavour](), Flight(it)
        names = self.flavour.airspeeds
        own = {"TKOFF_ALT": 50.0} if flavour == "ardupilot" else {}
        known = dict(zip(names, SPEEDS[flavour], strict=True)) | own | dict(settings)
        it.beat(kind=1)
        it.vehicle.state = msgspec.structs.replace(it.vehicle.state, settings=known)
        self.at(0.0, GROUND)

    def at(self, height, landed=AIR, *, mode=None):
        self.flight.shown = mode or self.flight.shown
        self.it.receive(ExtendedSysState(landed))
        altitude = round((HOME + height) * 1e3)
        self.it.receive(GlobalPositionInt(1, *PLACE, altitude, round(height * 1e3), 0, 0, 0, 0))

    def later(self, seconds, *height, **how):
        asyncio.get_running_loop().call_later(seconds, lambda: self.at(*height, **how))

    async def climb(self, altitude):
        climb = WingedTakeOff(self.flight, self.flavour, altitude).climb()
        async with asyncio.timeout(300.0):
            return [(step.percent, step.message) async for step in climb]

    @property
    def gone(self):
        return [each for each in self.flight.log if each[0] == "go"]


@pytest.fixture
def with_plane(run_in_sim_time, harness):
    """Run a test with a plane on the ground."""

    def with_plane(flavour, test, **more):
        async def main():
            await test(Plane(harness(flavour).in_loop(), flavour, **more))

        run_in_sim_time(main())

    return with_plane


def test_ardupilot_climbs_to_its_own_height_and_is_then_sent_into_a_circle_at_the_wanted_one(with_plane):
    async def test(plane):
        for second, height in enumerate((0.5, 20.0, 46.9, 47.0)):
            plane.later(second + 0.9, height)
        plane.later(10.0, 72.0)
        steps = await plane.climb(80.0)
        enter = plane.flavour.takeoff_command(80.0, HOME)
        assert plane.flight.log == [
            "end the stream for TAKEOFF",
            "arm",
            ("TAKEOFF", enter.command, enter.param7),
            ("go", PLACE[0] / 1e7, PLACE[1] / 1e7, HOME + 80.0, 15.0),
        ]
        assert plane.flight.gone_at == 47.0, "3 m below its own height"
        assert set(plane.flight.checked) == {("TAKEOFF", "LOITER"), ("GUIDED",)}
        assert steps[0] == (0.0, "taking off")
        assert (25.0, "at 20.0 m of 80 m") in steps
        assert steps[-1] == (100.0, "it circles at 72.0 m")

    with_plane("ardupilot", test)


def test_ardupilot_is_sent_into_a_circle_below_its_own_height_where_that_is_wanted(with_plane):
    async def test(plane):
        plane.later(1.9, 26.9)
        plane.later(5.9, 27.0)
        await plane.climb(30.0)
        assert len(plane.gone) == 1
        assert plane.flight.gone_at == 27.0

    with_plane("ardupilot", test)


def test_px4_climbs_to_its_height_and_circles_by_itself(with_plane):
    async def test(plane):
        plane.later(0.9, 5.0, mode="AUTO.TAKEOFF")
        plane.later(2.9, 60.0, GROUND, mode="AUTO.LOITER")
        plane.later(4.9, 60.0, mode="AUTO.LOITER")
        steps = await plane.climb(60.0)
        assert plane.gone == []
        assert steps[-1] == (100.0, "it circles at 60.0 m")
        assert asyncio.get_running_loop().time() > 4.0, "not before it is in the air"

    with_plane("px4", test)


@pytest.mark.parametrize(("height", "near"), [(52.0, True), (68.0, True), (51.9, False), (68.1, False)])
def test_px4_that_circles_at_another_height_is_sent_to_the_wanted_one(with_plane, height, near):
    async def test(plane):
        plane.later(0.9, height, mode="AUTO.LOITER")
        plane.later(5.0, 60.0, mode="AUTO.LOITER")
        await plane.climb(60.0)
        assert plane.gone == ([] if near else [("go", PLACE[0] / 1e7, PLACE[1] / 1e7, HOME + 60.0, 15.0)])

    with_plane("px4", test)


@both
def test_a_plane_that_flies_is_neither_armed_nor_made_to_take_off(with_plane, flavour):
    async def test(plane):
        plane.at(40.0)
        plane.later(3.0, 60.0)
        await plane.climb(60.0)
        assert "arm" not in plane.flight.log
        assert [each[0] for each in plane.flight.log[1:]] == ["go"]

    with_plane(flavour, test)


@both
@pytest.mark.parametrize("armed", [True, False])
def test_a_plane_that_stays_on_the_ground_is_given_up_and_disarmed_if_it_was_armed_for_this(
    with_plane, flavour, armed
):
    async def test(plane):
        plane.it.beat(kind=1, armed=armed)
        began = asyncio.get_running_loop().time()
        plane.at(0.9, GROUND)
        with pytest.raises(TimedOut, match="it did not leave the ground in 30 s"):
            await plane.climb(60.0)
        assert asyncio.get_running_loop().time() - began == pytest.approx(30.5, abs=0.6)
        assert ("disarm" in plane.flight.log) is not armed

    with_plane(flavour, test)


@pytest.mark.parametrize("own", [0.0, 2.0, 3.0])
def test_a_plane_on_the_ground_is_not_up_however_low_its_own_height_is(with_plane, own):
    async def test(plane):
        with pytest.raises(TimedOut, match="did not leave the ground"):
            await plane.climb(60.0)
        assert plane.gone == []

    with_plane("ardupilot", test, settings={"TKOFF_ALT": own})


@both
def test_a_plane_that_climbs_slowly_is_not_given_up(with_plane, flavour):
    async def test(plane):
        plane.at(1.0)
        plane.later(50.0, 60.0, mode="AUTO.LOITER")
        assert (await plane.climb(60.0))[-1][0] == 100.0

    with_plane(flavour, test)


@both
def test_a_take_off_that_another_command_ends_is_over(with_plane, flavour):
    async def test(plane):
        plane.flight.refusal = Refused("taken over")
        with pytest.raises(Refused, match="taken over"):
            await plane.climb(60.0)
        plane.at(40.0)
        with pytest.raises(Refused, match="taken over"):
            await plane.climb(60.0)

    with_plane(flavour, test)


def test_ardupilot_does_not_take_off_before_its_own_height_is_known(with_plane):
    async def test(plane):
        with pytest.raises(NotReady, match="TKOFF_ALT is not known yet") as caught:
            await plane.climb(60.0)
        assert caught.value.hint == "it is read after the vehicle connects; try again"
        assert plane.flight.log == []

    with_plane("ardupilot", test, settings={"TKOFF_ALT": None})


@both
def test_a_plane_that_may_not_fly_as_fast_as_it_must_does_not_take_off(with_plane, flavour):
    async def test(plane):
        plane.flight.fastest = 5.0
        with pytest.raises(Refused, match="its limit is 5 m/s"):
            await plane.climb(60.0)
        assert plane.flight.log == []

    with_plane(flavour, test)


@both
def test_the_progress_of_a_climb_is_between_0_and_99(with_plane, flavour):
    async def test(plane):
        plane.later(0.9, -3.0)
        plane.later(2.9, 200.0)
        plane.later(8.9, 60.0, mode="AUTO.LOITER")
        percents = [percent for percent, _ in await plane.climb(60.0)]
        assert (min(percents), percents[-1]) == (0.0, 100.0)
        assert max(percents[:-1]) == 99.0

    with_plane(flavour, test)
