"""The adapter on a bad day: links that lose, vehicles that clash, sets of wrong ids."""

import asyncio

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import Goal, GoTo, LinkLost, LinkRefused, NotReady, Refused, Vector3, Velocity
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
from fleet.testing.robot import LoopRobot, serve
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.constants import MavCmd

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
ELSEWHERE = ("10.9.9.9", 14550)
POSHOLD = 16
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}


@both
def test_everything_is_reported_at_its_rate(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


@both
def test_what_the_autopilot_says_is_passed_on(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("arm")
            await asyncio.sleep(1)
            said = [report.message for report in it.robot.reports_of(LogReport)]
            assert any("rm" in text for text in said)
            controller = [each for each in it.robot.reports if isinstance(each, FlightControllerReport)][-1]
            assert controller.armed
            assert controller.status_texts

    run_in_sim_time(main())


@both
def test_a_lossy_link_still_flies(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, faults={"ack_loss": 0.4}) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 3.0)
            await it.adapter.stop("stop")
            await it.do("land")
            assert not it.armed

    run_in_sim_time(main())


@both
def test_slow_answers_are_waited_for(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            it.sim.set_fault("slow_ack", 2.5)
            await it.do("arm")
            assert it.armed
            assert len(it.requested(MavCmd.COMPONENT_ARM_DISARM)) == 1

    run_in_sim_time(main())


@both
def test_a_second_vehicle_with_the_same_id_ends_motion_but_not_the_hold(
    run_in_sim_time, sim_flight, frame_of, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


def test_the_ids_that_are_heard_are_reported_when_ours_is_not_among_them(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", system_id=42) as it:
            await it.until(
                lambda: it.robot.healths and "received system 1 instead" in it.robot.healths[-1].cause,
                within=5.0,
            )
            assert "no heartbeat from system 42" in it.robot.healths[-1].cause

    run_in_sim_time(main())


def test_a_link_that_falls_ends_the_run(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            it._peer.unplug("cable out")
            with pytest.raises(LinkLost, match="cable out"):
                await it.run
            await it.adapter.stop("the link is gone")
            it.adapter.halt()

    run_in_sim_time(main())


def test_a_link_that_cannot_be_opened_ends_the_run(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", link="tcp:127.0.0.1:1") as it:
            with pytest.raises((LinkLost, LinkRefused)):
                await it.run

    run_in_sim_time(main())


def test_the_worlds_origin_is_the_one_of_fleet_yaml(run_in_sim_time, sim_flight):
    async def main():
        origin = {"latitude": 47.397742, "longitude": 8.545594, "altitude": 480.0}
        async with sim_flight("px4", origin=origin) as it:
            await it.wait_until_known()
            await asyncio.sleep(1)
            pose = [each for each in it.robot.reports if isinstance(each, PoseReport)][-1]
            assert pose.position.z == pytest.approx(8.0, abs=0.5)

    run_in_sim_time(main())


def test_an_offboard_that_nobody_feeds_is_braked_and_left(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("takeoff")
            driver = it.adapter._session.driver
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            assert it.mode == "OFFBOARD"
            driver.end()  # as if a start had been overtaken
            await it.until(lambda: it.mode == "LOITER", within=4.0)

    run_in_sim_time(main())


def test_a_fail_safe_is_reported_and_not_fought(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4") as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 2.0)
            it.sim.set_fault("low_battery", 4.0)
            await it.until(lambda: it.robot.losses, within=30.0)
            streamed = len(it.setpoints)
            await asyncio.sleep(3)
            assert len(it.setpoints) == streamed

    run_in_sim_time(main())


@both
def test_a_vehicle_that_was_lost_on_its_way_flies_on_until_the_hosts_stop_when_it_is_back(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
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

    run_in_sim_time(main())


UNHEARD = {
    "emergency halt": lambda adapter: adapter.emergency_halt(),
    "emergency stop": lambda adapter: adapter.halt_unheard("emergency_stop"),
    "stop": lambda adapter: adapter.halt_unheard("stop"),
}


@pytest.mark.parametrize("stop", UNHEARD.values(), ids=UNHEARD.keys())
@pytest.mark.parametrize("vehicle", ["multirotor", "plane", "rover"])
def test_a_requested_stop_is_written_to_a_vehicle_that_is_not_heard(
    run_in_sim_time, sim_flight, vehicle, stop
):
    async def main():
        async with sim_flight("ardupilot", vehicle=vehicle, limits={"speed": 30.0, "distance": 5000.0}) as it:
            await it.wait_until_known()
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
            stop(it.adapter)
            await it.until(lambda: it.mode in {"BRAKE", "LOITER", "HOLD"}, within=1.0)
            going.cancel()

    run_in_sim_time(main())


@both
@pytest.mark.parametrize("reason", ["stop", "hover", "emergency_stop"])
def test_a_stop_is_written_to_what_was_last_seen_on_the_ground_or_on_its_way_down(
    run_in_sim_time, sim_flight, flavour, reason
):
    """What is silent may have been armed since, and a landing may be what has to be broken off."""

    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            it.mute = True
            await asyncio.sleep(4.0)
            assert not it.state.armed
            before = len(it.commands)
            assert it.adapter.halt_unheard(reason)
            assert len(it.commands) > before
            it.mute = False
            await it.until(lambda: it.adapter._session.vehicle.connected)
            await it.do("takeoff", altitude=20.0)
            coming = asyncio.ensure_future(it.do("land"))
            await asyncio.sleep(2.0)
            it.mute = True
            await asyncio.sleep(4.0)
            assert it.adapter.halt_unheard(reason)
            await it.until(lambda: it.mode == HOLD[flavour], within=1.0)
            coming.cancel()

    run_in_sim_time(main())


@both
def test_a_stop_by_the_adapter_is_written_before_the_host_knows_that_it_is_silent(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff")
            going = asyncio.ensure_future(it.do("land"))
            await asyncio.sleep(1.0)
            it.mute = True
            await asyncio.sleep(3.1)
            with pytest.raises(
                NotReady, match="no heartbeat from system 1: the stop was written, and not seen"
            ):
                await it.adapter.stop("stop")
            await it.until(lambda: it.mode == HOLD[flavour], within=1.0)
            going.cancel()

    run_in_sim_time(main())


def test_a_plain_stop_of_a_silent_vehicle_leaves_it_to_its_pilot_and_says_so(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await it.wait_until_known()
            await it.do("takeoff")
            it.send_from_station(
                mav.MAVLink_command_long_message(1, 1, MavCmd.DO_SET_MODE, 0, 1, POSHOLD, 0, 0, 0, 0, 0)
            )
            await it.until(lambda: it.robot.losses)
            it.mute = True
            await asyncio.sleep(4.0)
            with pytest.raises(
                Refused, match=r"a pilot or a fail-safe has it, in POSHOLD: it was left to that"
            ):
                it.adapter.halt_unheard("stop")
            assert it.adapter.halt_unheard("hover")
            await it.until(lambda: it.mode == HOLD["ardupilot"], within=1.0)

    run_in_sim_time(main())


def test_a_stop_is_written_to_a_vehicle_that_was_never_heard_as_any_autopilot_takes_it(
    run_in_sim_time, sim_flight
):
    async def main():
        async with sim_flight("ardupilot") as it:
            it.mute = True
            await asyncio.sleep(1.0)
            assert it.state.heartbeat is None
            assert it.adapter.halt_unheard("stop")
            await asyncio.sleep(0.1)
            assert it.order[-2:] == [0, MavCmd.DO_PAUSE_CONTINUE]
            with pytest.raises(NotReady, match="no heartbeat from system 1: the stop was written"):
                await it.adapter.stop("emergency_stop")

    run_in_sim_time(main())


def test_a_stop_for_which_there_is_no_address_yet_is_not_called_written(run_in_sim_time):
    async def main():
        config = MavlinkConfig(name="kestrel", twin=TWIN, adapter="mavlink", link="udpin:127.0.0.1:0")
        robot = LoopRobot("kestrel", config.limits.over(MavlinkAdapter.limits))
        adapter = MavlinkAdapter(config, robot)
        run = asyncio.ensure_future(serve(adapter))
        await robot.until(lambda: hasattr(adapter, "_session"))
        for stop in (lambda: adapter.halt_unheard("stop"), lambda: adapter.halt_unheard("emergency_stop")):
            with pytest.raises(LinkLost, match=r"address on udpin:127.0.0.1:\d+ is not known yet"):
                stop()
        with pytest.raises(NotReady, match="it is unknown whether it stops: the vehicle's address"):
            await adapter.stop("stop")
        robot.close()
        run.cancel()
        await asyncio.gather(run, return_exceptions=True)

    run_in_sim_time(main())
