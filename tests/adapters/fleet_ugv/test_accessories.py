"""Lamps and the camera mount of a base: what was commanded last, its limits, and that a stop holds it."""

import asyncio
import math

import pytest

from fleet import Refused, Vector3, Velocity
from fleet.model.report import JointReport


def forward(speed, yaw_rate=0.0):
    return Velocity(Vector3(speed), yaw_rate)


async def test_lamps_toggle_and_are_set_in_all_the_words_there_are(bench):
    for command, data, lamps in (
        ("chassis_light_toggle", {}, (255, 0)),
        ("camera_light_toggle", {}, (255, 255)),
        ("led_toggle", {}, (0, 0)),
        ("lights", {"pwm": 255}, (255, 255)),
        ("lights", {"io4": 10}, (10, 255)),
        ("lights", {"camera_light": 3}, (10, 3)),
        ("lights", {"data": [1, 2]}, (1, 2)),
        ("lights", {"all": 0}, (0, 0)),
    ):
        await bench.do(command, **data)
        await bench.pass_time(0.04)
        assert bench.board.lamps == lamps, command
    with pytest.raises(Refused, match="no brightness"):
        await bench.do("lights")
    for data in ({"all": 300}, {"pwm": -1}, {"data": [1, 256]}):
        with pytest.raises(Refused, match="must be 0 to 255"):
            await bench.do("lights", **data)
    assert bench.board.lamps == (0, 0)


async def test_the_camera_turns_in_steps_within_its_limits_and_its_joints_are_reported(make_bench):
    bench = await make_bench(module="pan-tilt").ready()
    await bench.do("camera_left")
    await bench.do("camera_up")
    await bench.pass_time(0.3)
    assert bench.board.camera == (-6.0, 6.0)
    assert bench.last(JointReport).positions["pan"] == pytest.approx(-0.105, abs=0.01)
    with pytest.raises(Refused, match="tilt must be"):
        await bench.do("camera_servo", pan=1.0, tilt=-9.0)
    await bench.do("camera_servo", pan=1.0, tilt_delta=-2.0)
    await bench.pass_time(1.5)
    assert bench.board.camera == (57.0, -30.0)
    await bench.do("camera_default")
    await bench.pass_time(1.5)
    assert bench.board.camera == (0.0, 0.0)


async def test_the_mounts_joints_are_led_and_held_where_they_are(make_bench):
    bench = await make_bench(module="pan-tilt").ready()
    assert set(bench.adapter.joint_ranges()) == {"pan", "tilt"}
    bench.adapter.move_joints({"pan": 1.0})
    await bench.pass_time(0.5)
    bench.adapter.hold_joints()
    await bench.pass_time(0.1)
    held = bench.board.camera
    assert 15.0 < held[0] < 35.0
    await bench.pass_time(1.0)
    assert bench.board.camera == held
    await bench.do("camera_up")  # from where it is, not from where it was sent
    await bench.pass_time(1.0)
    assert bench.board.camera == pytest.approx((held[0], 5.7), abs=1.0)


async def test_the_mount_turns_as_fast_as_it_is_declared(make_bench):
    bench = await make_bench(module="pan-tilt").ready()
    bench.adapter.move_joints({"pan": 1.5})
    await bench.pass_time(1.0)
    assert math.radians(bench.board.camera[0]) == pytest.approx(
        bench.adapter.joint_ranges()["pan"].speed, rel=0.1
    )


@pytest.mark.parametrize("stop", ["halt", "stop"])
async def test_any_stop_holds_the_mount_and_it_does_not_fall_behind_a_later_target(make_bench, stop):
    bench = await make_bench(module="pan-tilt").ready()
    bench.adapter.move_joints({"pan": 2.0, "tilt": 1.0})
    await bench.pass_time(0.3)
    if stop == "halt":
        bench.adapter.halt()
    else:
        await asyncio.gather(bench.adapter.stop("a test"), bench.pass_time(0.1))
    await bench.pass_time(0.1)
    held = bench.board.camera
    bench.adapter.drive(forward(0.2))
    bench.adapter.move_joints({"pan": math.radians(held[0]) + 0.2})
    await bench.pass_time(1.0)
    assert bench.board.camera == pytest.approx((held[0] + 11.0, held[1]), abs=1.5)
    assert bench.board.physics.x > 0.05


@pytest.mark.parametrize(("profile", "module"), [("waveshare-beast", "none"), ("hoverboard", "none")])
async def test_a_base_without_a_mount_has_no_joints_that_are_led(make_bench, profile, module):
    bench = await make_bench(profile, module=module).ready()
    assert bench.adapter.joint_ranges() == {}
