"""A robot kept inside its fence and within its battery."""

import pytest

from fleet.errors import Refused
from fleet.host.robot.outside_fence import ALLOWED_OUTSIDE
from fleet.model.command import ReplyStatus
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import ZERO_VELOCITY, Vector3, quaternion_from_yaw
from fleet.model.navigation import Control, FollowPath, Goal, GoTo, Navigate, RelativeMove
from fleet.model.report import BatteryReport, FlightControllerReport

YARD = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]
FENCE = {"inclusion": [YARD]}
POLICY = {"reserve": 20, "low": 15, "endurance": 100}
REJECTED = ReplyStatus.REJECTED


def goal(requests, task):
    """Return the navigation message of a task."""
    return Navigate(task, "", requests.goal().origin)


async def test_a_goal_outside_is_refused_before_the_robot_hears_of_it(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose()
    (answer,) = bench.request(goal(requests, GoTo(Goal(Vector3(30, 0, 0)))))
    assert (answer.status, answer.reason) == (REJECTED, "goal 1 is outside the fence")
    assert bench.statuses() == ["failed"]
    assert bench.adapter.calls == []


async def test_every_goal_of_a_path_and_the_end_of_a_move_are_judged(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose(15.0, rotation=quaternion_from_yaw(0.0))
    path = FollowPath((Goal(Vector3(1, 1, 0)), Goal(Vector3(1, 21, 0))))
    assert "goal 2" in bench.request(goal(requests, path))[0].reason
    assert "outside" in bench.request(goal(requests, RelativeMove(Vector3(6, 0, 0))))[0].reason
    assert bench.request(goal(requests, RelativeMove(Vector3(-6, 0, 0))))[0].ok


async def test_a_geodetic_fence_and_goal_count_from_the_origin(make_bench, requests):
    origin = {"latitude": 47.0, "longitude": 8.0}
    corners = [(46.999, 7.999), (47.001, 7.999), (47.001, 8.001), (46.999, 8.001)]
    bench = make_bench(fence={"frame": "geodetic", "inclusion": [corners]}, origin=origin)
    bench.report_pose()
    assert bench.request(goal(requests, GoTo(Goal(geo=GeoPoint(47.0009, 8.0)))))[0].ok
    bench.report_pose()
    assert not bench.request(goal(requests, GoTo(Goal(geo=GeoPoint(47.0011, 8.0)))))[0].ok


async def test_without_an_origin_the_corners_are_placed_once_home_is_known(make_bench, requests):
    corners = [(46.999, 7.999), (47.001, 7.999), (47.001, 8.001), (46.999, 8.001)]
    bench = make_bench(fence={"frame": "geodetic", "inclusion": [corners]})
    bench.report_pose()
    assert "cannot be placed" in bench.request(goal(requests, GoTo(Goal(Vector3(5, 0, 0)))))[0].reason
    home = GeoPoint(47.0, 8.0, 400.0)
    bench.controller.guard.observe(
        FlightControllerReport(0.0, armed=False, mode="", failsafe=False, home=home)
    )
    assert bench.request(goal(requests, GoTo(Goal(Vector3(5, 0, 0)))))[0].ok


async def test_a_velocity_is_held_only_as_far_as_it_keeps_the_fence(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose()
    assert bench.request(requests.setpoint(2.0))[0].ok
    assert bench.adapter.calls[-1].linear.x == 2.0
    bench.report_pose(18.0)
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert bench.request(requests.setpoint(2.0))[0].ok
    assert bench.adapter.calls[-1] == ZERO_VELOCITY
    assert bench.request(requests.setpoint(-1.0))[0].ok
    assert bench.adapter.calls[-1].linear.x == -1.0


def lease_runs_out(bench, requests):
    bench.request(requests.setpoint(1.0))
    bench.controller.deadman.expire(bench.controller.deadman.until)
    bench.controller.motion.lease_ran_out()


def lease_runs_out_as_the_goal_comes(bench, requests):
    bench.request(requests.setpoint(1.0))
    bench.controller.deadman.expire(bench.controller.deadman.until)


def is_refused(bench, requests):
    bench.adapter.raises = Refused("not today")
    bench.request(requests.setpoint(1.0))


def makes_the_adapter_fail(bench, requests):
    bench.adapter.raises = ZeroDivisionError("oops")
    bench.request(requests.setpoint(1.0))


@pytest.mark.parametrize(
    "ends", [lease_runs_out, lease_runs_out_as_the_goal_comes, is_refused, makes_the_adapter_fail]
)
async def test_a_velocity_that_has_ended_ends_no_goal_near_the_fence(make_bench, requests, ends):
    bench = make_bench(fence=FENCE)
    bench.report_pose()
    ends(bench, requests)
    bench.adapter.raises = None
    bench.request(goal(requests, GoTo(Goal(Vector3(19, 0, 0)))))
    await requests.settle()
    bench.report_pose(18.5)
    await requests.settle()
    assert bench.statuses()[-1] == "running"
    assert "stop" not in bench.adapter.calls


async def test_a_velocity_is_refused_while_nobody_knows_where_the_robot_is(make_bench, requests):
    bench = make_bench(fence=FENCE)
    assert "unknown" in bench.request(requests.setpoint(1.0))[0].reason
    bench.report_pose()
    bench.clock.advance(2.0)
    assert "unknown" in bench.request(requests.setpoint(1.0))[0].reason


async def test_a_robot_blown_out_on_the_way_to_a_goal_is_stopped_and_reported_once(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose()
    bench.request(goal(requests, GoTo(Goal(Vector3(10, 0, 0)))))
    await requests.settle()
    for x in (19.0, 22.0, 23.0):
        bench.report_pose(x)
    await requests.settle()
    assert bench.adapter.calls[-1] == "stop"
    assert bench.reports[-1].message == "fence: it is outside the fence"
    assert bench.statuses()[-1] == "failed"
    assert len(bench.telemetry_of("fence_breached")) == 1


async def test_a_robot_that_somebody_else_flies_is_reported_but_not_touched(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose(30.0)
    await requests.settle()
    assert bench.adapter.calls == []
    assert bench.telemetry_of("fence_breached")


async def test_a_flight_does_not_begin_outside_or_with_too_little_battery(make_bench, requests):
    bench = make_bench(fence=FENCE, battery_policy=POLICY)
    bench.report_pose(30.0)
    bench.report_battery(90.0)
    assert (
        bench.request(requests.command("takeoff"))[0].reason == f"it is outside the fence; {ALLOWED_OUTSIDE}"
    )
    bench.report_pose()
    bench.report_battery(19.0)
    assert "19 %" in bench.request(requests.command("takeoff"))[0].reason
    bench.report_battery(90.0)
    bench.request(requests.command("takeoff"))
    await requests.settle()
    assert bench.adapter.calls == [("takeoff", None)]


async def test_from_outside_only_a_goal_inside_on_a_way_back_is_taken(make_bench, requests):
    bench = make_bench(fence={**FENCE, "exclusion": [[(18.0, -2.0), (19.0, -2.0), (19.0, 2.0), (18.0, 2.0)]]})
    bench.report_pose(30.0)
    for task in (
        GoTo(Goal(Vector3(25, 0, 0))),
        GoTo(Goal(Vector3(10, 0, 0))),
        RelativeMove(Vector3(0, 5, 0)),
    ):
        (answer,) = bench.request(goal(requests, task))
        assert not answer.ok
        assert answer.reason.endswith(ALLOWED_OUTSIDE)
    assert bench.adapter.calls == []
    assert bench.request(goal(requests, GoTo(Goal(Vector3(10, 15, 0)))))[0].ok


async def test_a_limit_of_the_distance_needs_a_position_as_a_fence_does(make_bench, requests):
    bench = make_bench(limits={"distance": 50.0})
    assert "position is unknown" in bench.request(requests.setpoint(1.0))[0].reason
    assert "position is unknown" in bench.request(requests.command("takeoff"))[0].reason
    bench.report_pose()
    assert bench.request(requests.setpoint(1.0))[0].ok


WALL = [(4.0, -2.0), (6.0, -2.0), (6.0, 2.0), (4.0, 2.0)]


@pytest.mark.parametrize(
    ("moved_to", "percent", "refusal"),
    [
        ((0.0, 0.0), 90.0, ""),
        ((0.0, 0.0), 21.0, "20 % must be left"),
        ((2.0, -10.0), 90.0, "the straight way to goal 1 leads out"),
    ],
)
async def test_a_paused_goal_is_gone_on_with_only_where_it_might_begin(
    make_bench, requests, moved_to, percent, refusal
):
    bench = make_bench(fence={**FENCE, "exclusion": [WALL]}, battery_policy=POLICY)

    bench.report_pose()
    bench.report_battery(90.0)
    bench.request(goal(requests, GoTo(Goal(Vector3(8, 10, 0)))))
    await requests.settle()
    paused = bench.request(Navigate(Control.PAUSE, "", requests.goal().origin))
    await requests.settle()
    assert paused[0].ok
    bench.report_pose(*moved_to)
    bench.report_battery(percent)
    await requests.settle()
    (answer,) = bench.request(Navigate(Control.RESUME, "", requests.goal().origin))
    assert answer.ok is not bool(refusal)
    assert refusal in answer.reason


async def test_a_goal_of_what_circles_must_lie_so_far_within_the_fence(make_bench, requests):
    bench = make_bench(fence=FENCE)
    bench.report_pose()
    bench.controller.guard.circles(15.0)
    near = bench.request(goal(requests, GoTo(Goal(Vector3(10, 0, 0)))))[0]
    assert near.reason == "goal 1 is 10 m from the fence, and it circles 15 m about it"
    assert bench.request(goal(requests, GoTo(Goal(Vector3(4, 0, 0)))))[0].ok
    bench.controller.guard.circles(0.0)
    assert bench.request(goal(requests, GoTo(Goal(Vector3(10, 0, 0)))))[0].ok


async def test_the_reserve_counts_a_circle_over_home(make_bench, requests):
    bench = make_bench(battery_policy=POLICY, limits={"speed": 1.0})
    bench.report_pose()
    bench.controller.guard.observe(BatteryReport(0.0, percent=60.0))
    far = goal(requests, GoTo(Goal(Vector3(15, 0, 0))))
    bench.controller.guard.circles(5.0)
    refused = bench.request(far)[0]
    assert "the way there and home takes 61 % and 20 % must be left" in refused.reason
    bench.controller.guard.circles(0.0)
    assert bench.request(far)[0].ok
