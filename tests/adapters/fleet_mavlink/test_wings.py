"""Planes: the list that real ones are flown through, flown by the simulated ones."""

import pytest

from fleet import NotReady, Refused
from fleet_mavlink.px4_plane import Px4Plane
from fleet_mavlink.state import VehicleState


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_planes_fly_the_list(fly, sky, module_at, flavour):
    lines = []

    async def main():
        async with sky(flavour, vehicle="plane", limits={"speed": 30.0}) as it:
            await module_at("sitl/plane_list.py").fly(it, lines.append)

    fly(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/plane_list.py").STEPS)


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_vtols_fly_the_list(fly, sky, module_at, flavour):
    lines = []

    async def main():
        async with sky(flavour, vehicle="vtol", limits={"speed": 30.0}) as it:
            planes = module_at("sitl/plane_list.py")
            await module_at("sitl/vtol_list.py").fly(it, planes, lines.append)

    fly(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/vtol_list.py").STEPS)


TOLD = VehicleState(settings={"FW_AIRSPD_MIN": 10.0, "FW_AIRSPD_TRIM": 15.0, "FW_AIRSPD_MAX": 20.0})


@pytest.mark.parametrize(
    ("limit", "wanted", "airspeed"),
    [(30.0, None, 15.0), (12.0, None, 12.0), (30.0, 18.0, 18.0), (30.0, 99.0, 20.0), (None, 12.0, 12.0)],
)
def test_a_goal_is_flown_at_what_is_asked_for_within_the_limit_and_the_fastest(limit, wanted, airspeed):
    assert Px4Plane().airspeed(TOLD, limit, wanted) == airspeed


def test_an_airspeed_under_the_slowest_is_refused_with_whose_it_is():
    with pytest.raises(Refused, match="its limit is 5 m/s"):
        Px4Plane().airspeed(TOLD, 5.0, None)
    with pytest.raises(Refused, match="it was asked for 4 m/s"):
        Px4Plane().airspeed(TOLD, 30.0, 4.0)
    with pytest.raises(NotReady, match="not known yet"):
        Px4Plane().airspeed(VehicleState(), 30.0, None)


def test_a_plane_does_not_take_off_under_the_limit_of_a_multirotor(fly, sky):
    async def main():
        async with sky("px4", vehicle="plane") as it:
            await it.met()
            await it.until(lambda: "FW_AIRSPD_MIN" in it.state.settings)
            with pytest.raises(Refused, match=r"its limit is 5 m/s"):
                await it.do("takeoff", altitude=30.0)
            assert not it.armed

    fly(main())


def test_a_halted_plane_is_sent_into_its_circle_and_no_velocity(fly, sky):
    async def main():
        async with sky("ardupilot", vehicle="plane", limits={"speed": 30.0}) as it:
            await it.met()
            await it.until(lambda: "TKOFF_ALT" in it.state.settings)
            await it.do("takeoff", altitude=40.0)
            it.adapter.halt()
            await it.until(lambda: it.mode == "LOITER", 10.0)
            assert it.setpoints == []

    fly(main())


def test_a_quadplane_as_it_is_delivered_lands_when_it_is_stopped_in_its_hover(fly, sky):
    async def main():
        async with sky("ardupilot", vehicle="vtol", limits={"speed": 30.0}) as it:
            await it.met()
            await it.until(lambda: "Q_GUIDED_MODE" in it.state.settings)
            await it.do("set_parameter", name="Q_GUIDED_MODE", value=1)
            await it.until(lambda: "takeoff" not in it.robot.lacking)
            await it.do("takeoff", altitude=20.0)
            await it.do("set_parameter", name="Q_GUIDED_MODE", value=0, force=True)
            await it.adapter.stop("emergency_stop")
            assert it.mode == "QLAND"

    fly(main())
