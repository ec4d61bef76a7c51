"""Gimbal and camera."""

import asyncio

import pytest

from fleet import Fault, NotReady, Refused, Unsupported
from fleet_mavlink.constants import MavCmd

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
GIMBAL = {"accessories": ("gimbal",)}


@both
def test_the_gimbal_turns_where_it_is_asked_and_leaves_the_other_axis(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, **GIMBAL) as it:
            await it.wait_until_known()
            gimbal = it.sim.equipment.gimbal
            await it.do("gimbal_rotate", pitch=-45.0, yaw=20.0)
            assert (gimbal.pitch, gimbal.yaw) == (pytest.approx(-45, abs=3), pytest.approx(20, abs=3))
            await it.do("gimbal_rotate", pitch=10.0, mode="relative")
            assert (gimbal.pitch, gimbal.yaw) == (pytest.approx(-35, abs=4), pytest.approx(20, abs=3))
            await it.do("set_gimbal_pitch", pitch=-90.0)
            assert gimbal.pitch == pytest.approx(-90, abs=3)

    run_in_sim_time(main())


@both
def test_a_turn_takes_the_time_it_is_given(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, **GIMBAL) as it:
            await it.wait_until_known()
            await it.until(lambda: it.state.sensors.aim is not None)
            began = it.now
            await it.do("gimbal_rotate", pitch=-40.0, duration=4.0)
            assert it.now - began == pytest.approx(4.0, abs=1.0)

    run_in_sim_time(main())


@both
def test_a_turning_speed_ends_by_itself(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, **GIMBAL) as it:
            await it.wait_until_known()
            gimbal = it.sim.equipment.gimbal
            await it.do("gimbal_pitch_down", rate=20.0)
            await asyncio.sleep(3.0)
            assert gimbal.pitch == pytest.approx(-20, abs=4)
            for _ in range(4):
                await it.do("gimbal_rotate_speed", yaw=200)  # tenths of a degree a second
                await asyncio.sleep(0.5)
            await asyncio.sleep(3.0)
            assert gimbal.yaw == pytest.approx(50, abs=6)
            await it.do("gimbal_rotate_speed", pitch_rate=10.0)
            await it.do("gimbal_rotate_speed", pitch_rate=0.0)
            before = gimbal.pitch
            await asyncio.sleep(2.0)
            assert gimbal.pitch == pytest.approx(before, abs=0.5)

    run_in_sim_time(main())


@both
def test_angles_beyond_the_gimbals_are_refused(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, **GIMBAL) as it:
            await it.wait_until_known()
            for bad in (
                {"pitch": -120.0},
                {"yaw": 170.0},
                {"pitch": 1.0, "roll": 5.0},
                {},
                {"pitch": 1.0, "duration": 99.0},
            ):
                with pytest.raises(Refused):
                    await it.do("gimbal_rotate", **bad)
            with pytest.raises(Refused):
                await it.do("gimbal_pitch_up", rate=1000.0)
            assert not it.requested(MavCmd.DO_GIMBAL_MANAGER_PITCHYAW)

    run_in_sim_time(main())


@both
def test_a_vehicle_without_a_gimbal_says_so(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            with pytest.raises(Unsupported, match="no gimbal"):
                await it.do("gimbal_rotate", pitch=0.0)

    run_in_sim_time(main())


def test_a_gimbal_that_is_turned_by_another_station_is_taken_back(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", **GIMBAL) as it:
            await it.wait_until_known()
            await it.do("set_gimbal_pitch", pitch=-10.0)
            it.sim.equipment.gimbal._owner = (255, 190)
            with pytest.raises(Refused):
                await it.do("set_gimbal_pitch", pitch=-20.0)
            await it.do("set_gimbal_pitch", pitch=-20.0)

    run_in_sim_time(main())


@both
def test_a_picture_is_taken_and_seen_to_be(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour, accessories=("camera",)) as it:
            await it.wait_until_known()
            await it.until(lambda: it.adapter._session.vehicle.camera)
            assert await it.do("take_photo") == {"index": 1, "url": "/DCIM/0001.jpg"}
            assert (await it.do("take_photo"))["index"] == 2
            assert it.requested(MavCmd.IMAGE_START_CAPTURE)[0].target_component != 1

    run_in_sim_time(main())


@both
def test_without_a_camera_no_picture_is_taken(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            with pytest.raises(Unsupported, match="no camera"):
                await it.do("take_photo")

    run_in_sim_time(main())


def test_a_camera_that_fails_or_falls_silent_is_reported(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("px4", accessories=("camera",)) as it:
            await it.wait_until_known()
            await it.until(lambda: it.adapter._session.vehicle.camera)
            it.sim.set_fault("camera_fails", 1.0)
            with pytest.raises(Fault, match="could not take"):
                await it.do("take_photo")
            it.wire._accessories.clear()
            await asyncio.sleep(4.0)
            with pytest.raises(NotReady, match="no heartbeat"):
                await it.do("take_photo")

    run_in_sim_time(main())
