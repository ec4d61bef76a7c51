"""Camera mount of a base: what was commanded last, its speed, and that a stop holds it."""

import asyncio
import math

import pytest

from fleet import Vector3, Velocity


def forward(speed, yaw_rate=0.0):
    return Velocity(Vector3(speed), yaw_rate)


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
