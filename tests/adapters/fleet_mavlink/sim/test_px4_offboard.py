"""OFFBOARD of PX4, as it was seen on the wire."""

import math

import pytest
from pymavlink.dialects.v20 import all as mav


@pytest.mark.parametrize(("frame", "north", "east"), [(1, 4, 0), (8, 0, 4)])
def test_velocity_frames(bench, frame, north, east):
    px4 = bench("px4", home=(47.397742, 8.545594, 488.0, 90.0))
    px4.climb()
    px4.stream(0.5, 0.0)
    px4.set_mode("OFFBOARD")
    px4.stream(4, 1.0, frame=frame)
    assert px4.body.north == pytest.approx(north, abs=0.7)
    assert px4.body.east == pytest.approx(east, abs=0.7)


@pytest.mark.parametrize("frame", [7, 9, 12])
def test_an_unsupported_frame_is_reported_and_lets_the_stream_die(offboard, frame):
    offboard.stream(1.5, 1.0, frame=frame)
    assert sum("unsupported" in text for text in offboard.texts) == 15
    assert offboard.mode == "POSCTL"


def test_the_heading_is_kept_without_yaw(offboard):
    offboard.stream(3, 0.0, 1.0, mask=0xDC7)
    assert offboard.body.heading == pytest.approx(0, abs=0.01)
    assert offboard.body.east > 2


def test_yaw_rate_turns_right(offboard):
    offboard.stream(4, 0.0, rate=0.5)
    assert 95 < math.degrees(offboard.body.heading) < 120


def test_a_lost_stream_comes_down_and_a_new_one_flies_again(offboard):
    offboard.stream(1, 1.0)
    offboard.run(1.2)
    assert offboard.mode == "POSCTL"
    height = offboard.height
    offboard.run(2.5)
    assert offboard.height < height - 1.2
    assert offboard.last("HEARTBEAT").system_status == mav.MAV_STATE_CRITICAL
    offboard.stream(0.6, 1.0)
    assert offboard.mode == "OFFBOARD"
    offboard.stream(1, 1.0)
    assert offboard.body.speed > 0.8


def test_a_mode_chosen_during_the_loss_is_not_overruled(offboard):
    offboard.run(2)
    offboard.set_mode("LOITER")
    offboard.stream(1, 1.0)
    assert offboard.mode == "LOITER"


def test_three_setpoints_a_second_are_enough(offboard):
    for _ in range(12):
        offboard.drive(1.0, 0.0, 0.0)
        offboard.run(0.34)
    assert offboard.mode == "OFFBOARD"
