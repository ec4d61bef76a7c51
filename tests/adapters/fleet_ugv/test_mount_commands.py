"""Commands of the camera mount, and its joints."""

import pytest

from fleet import Refused
from fleet.model.report import JointReport


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


@pytest.mark.parametrize(("profile", "module"), [("waveshare-beast", "none"), ("hoverboard", "none")])
async def test_a_base_without_a_mount_has_no_joints_that_are_led(make_bench, profile, module):
    bench = await make_bench(profile, module=module).ready()
    assert bench.adapter.joint_ranges() == {}
