"""The adapter on a bad day: links that lose, vehicles that clash, sets of wrong ids."""

import asyncio

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import Goal, GoTo, LinkLost, LinkRefused, NotReady, Vector3, Velocity
from fleet.model.health import Level
from fleet.model.report import (
    BatteryReport,
    FlightControllerReport,
    GpsReport,
    LogReport,
    MetricsReport,
    PoseReport,
    TelemetryReport,
)
from fleet_mavlink.constants import Cmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
ELSEWHERE = ("10.9.9.9", 14550)


@both
def test_everything_is_reported_at_its_rate(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await asyncio.sleep(5)
            it.robot.reports.clear()
            await asyncio.sleep(10)
            count = {}
            for report in it.robot.reports:
                count[type(report)] = count.get(type(report), 0) + 1
            assert 95 <= count[PoseReport] <= 105
            assert 9 <= count[GpsReport] <= 11
            assert 4 <= count[BatteryReport] <= 6
            assert 2 <= count[FlightControllerReport] <= 4
            assert 4 <= count[MetricsReport] <= 6
            assert count[TelemetryReport] >= 9

    fly(main())


@both
def test_what_the_autopilot_says_is_passed_on(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("arm")
            await asyncio.sleep(1)
            said = [report.message for report in it.robot.reports_of(LogReport)]
            assert any("rm" in text for text in said)
            controller = [each for each in it.robot.reports if isinstance(each, FlightControllerReport)][-1]
            assert controller.armed
            assert controller.status_texts

    fly(main())


@both
def test_a_lossy_link_still_flies(fly, sky, flavour):
    async def main():
        async with sky(flavour, faults={"ack_loss": 0.4}) as it:
            await it.met()
            await it.do("takeoff", altitude=5.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 3.0)
            await it.adapter.stop("stop")
            await it.do("land")
            assert not it.armed

    fly(main())


@both
def test_slow_answers_are_waited_for(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            it.sim.set_fault("slow_ack", 2.5)
            await it.do("arm")
            assert it.armed
            assert len(it.asked(Cmd.COMPONENT_ARM_DISARM)) == 1

    fly(main())


@both
def test_a_second_vehicle_with_the_same_id_ends_motion_but_not_the_hold(fly, sky, frame_of, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff", altitude=6.0)
            vehicle = it.adapter._session.vehicle
            it.adapter._session._hub.receive(
                frame_of(mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)), ELSEWHERE
            )
            await it.until(lambda: vehicle.clashing, within=0.5)
            with pytest.raises(NotReady, match="two vehicles use system id 1"):
                it.adapter.drive(Velocity(Vector3(1.0, 0.0, 0.0)))
            await asyncio.sleep(0.5)
            assert it.robot.healths[-1].level is Level.FAULT
            await it.adapter.stop("stop")
            await it.until(lambda: it.robot.healths[-1].level is Level.OK, within=6.0)

    fly(main())


def test_the_ids_that_are_heard_are_told_when_ours_is_not_among_them(fly, sky):
    async def main():
        async with sky("px4", system_id=42) as it:
            await it.until(
                lambda: it.robot.healths and "systems 1 are heard" in it.robot.healths[-1].cause, within=5.0
            )
            assert "no heartbeat from system 42" in it.robot.healths[-1].cause

    fly(main())


def test_a_link_that_falls_ends_the_run(fly, sky):
    async def main():
        async with sky("px4") as it:
            await it.met()
            it._peer.unplug("cable out")
            with pytest.raises(LinkLost, match="cable out"):
                await it.run
            await it.adapter.stop("the link is gone")
            it.adapter.halt()

    fly(main())


def test_a_link_that_cannot_be_opened_ends_the_run(fly, sky):
    async def main():
        async with sky("px4", link="tcp:127.0.0.1:1") as it:
            with pytest.raises((LinkLost, LinkRefused)):
                await it.run

    fly(main())


def test_the_worlds_origin_is_the_one_of_fleet_yaml(fly, sky):
    async def main():
        origin = {"latitude": 47.397742, "longitude": 8.545594, "altitude": 480.0}
        async with sky("px4", origin=origin) as it:
            await it.met()
            await asyncio.sleep(1)
            pose = [each for each in it.robot.reports if isinstance(each, PoseReport)][-1]
            assert pose.position.z == pytest.approx(8.0, abs=0.5)

    fly(main())


def test_an_offboard_that_nobody_feeds_is_braked_and_left(fly, sky):
    async def main():
        async with sky("px4") as it:
            await it.met()
            await it.do("takeoff")
            driver = it.adapter._session.driver
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            assert it.mode == "OFFBOARD"
            driver.end()  # as if a start had been overtaken
            await it.until(lambda: it.mode == "LOITER", within=4.0)

    fly(main())


def test_a_fail_safe_is_told_and_not_fought(fly, sky):
    async def main():
        async with sky("px4") as it:
            await it.met()
            await it.do("takeoff", altitude=10.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            it.sim.set_fault("low_battery", 4.0)
            await it.until(lambda: it.robot.losses, within=30.0)
            streamed = len(it.setpoints)
            await asyncio.sleep(3)
            assert len(it.setpoints) == streamed

    fly(main())


@both
def test_a_vehicle_that_was_lost_on_its_way_flies_on_until_the_hosts_stop_when_it_is_back(fly, sky, flavour):
    async def main():
        async with sky(flavour) as it:
            await it.met()
            await it.do("takeoff")
            steps = it.adapter.navigate(GoTo(Goal(Vector3(200.0, 0.0, 10.0))))
            await anext(steps)
            it.radio = False
            await asyncio.sleep(3.5)
            it.adapter.halt()  # the host's, when it is told that the vehicle is gone
            it.radio = True
            with pytest.raises(NotReady, match="no heartbeat"):
                await anext(steps)
            await it.until(lambda: it.robot.healths[-1].level is not Level.OFFLINE)
            assert it.speed > 3.0
            await it.adapter.stop("it was lost while it moved")
            await it.until(lambda: it.speed < 0.2, within=6.0)
            assert it.robot.losses == []

    fly(main())


@pytest.mark.parametrize("vehicle", ["multirotor", "plane", "rover"])
def test_an_emergency_stop_is_written_to_a_vehicle_that_is_not_heard(fly, sky, vehicle):
    async def main():
        async with sky("ardupilot", vehicle=vehicle, limits={"speed": 30.0, "distance": 5000.0}) as it:
            await it.met()
            if vehicle == "rover":
                await it.do("arm")
            else:
                await it.until(lambda: vehicle != "plane" or "TKOFF_ALT" in it.state.settings)
                await it.do("takeoff", altitude=40.0)
            going = asyncio.ensure_future(
                anext(aiter(it.adapter.navigate(GoTo(Goal(Vector3(2000.0, 0.0, 40.0))))))
            )
            await it.until(lambda: it.mode == "GUIDED" and it.speed > 1.0)
            it.mute = True
            await asyncio.sleep(4.0)
            it.adapter.halt()
            await asyncio.sleep(0.5)
            assert it.mode == "GUIDED", "unasked, what is silent is left to its own fail-safe"
            it.adapter.emergency_halt()
            await it.until(lambda: it.mode in {"BRAKE", "LOITER", "HOLD"}, within=1.0)
            going.cancel()

    fly(main())
