"""A robot kept inside its fence and within its battery."""

import pytest

from fleet.errors import NotReady, Refused
from fleet.model.command import ReplyStatus
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import ZERO_VELOCITY, Quaternion, Vector3, quaternion_from_yaw
from fleet.model.navigation import Control, FollowPath, Goal, GoTo, Navigate, RelativeMove
from fleet.model.report import BatteryReport, FlightControllerReport, PoseReport, TelemetryReport

YARD = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]
FENCE = {"inclusion": [YARD]}
POLICY = {"reserve": 20, "low": 15, "endurance": 100}
REJECTED = ReplyStatus.REJECTED


def tell(bench, x=0.0, y=0.0, z=0.0, rotation=None):
    """Let the robot say where it is."""
    report = PoseReport(bench.clock.time(), Vector3(x, y, z), rotation or Quaternion())
    bench.desk.see(report)
    bench.desk.guard.see(report)


def goal(asks, task):
    """Return the navigation message of a task."""
    return Navigate(task, "", asks.goal().origin)


def told(bench, kind):
    """Return what was told of a kind on the telemetry channel."""
    return [each for each in bench.reports if isinstance(each, TelemetryReport) and each.type == kind]


async def test_a_goal_outside_is_refused_before_the_robot_hears_of_it(make_bench, asks):
    bench = make_bench(fence=FENCE)
    tell(bench)
    (answer,) = bench.ask(goal(asks, GoTo(Goal(Vector3(30, 0, 0)))))
    assert (answer.status, answer.reason) == (REJECTED, "goal 1 is outside the fence")
    assert bench.statuses() == ["failed"]
    assert bench.puppet.told == []


async def test_every_goal_of_a_path_and_the_end_of_a_move_are_judged(make_bench, asks):
    bench = make_bench(fence=FENCE)
    tell(bench, 15.0, rotation=quaternion_from_yaw(0.0))
    path = FollowPath((Goal(Vector3(1, 1, 0)), Goal(Vector3(1, 21, 0))))
    assert "goal 2" in bench.ask(goal(asks, path))[0].reason
    assert "outside" in bench.ask(goal(asks, RelativeMove(Vector3(6, 0, 0))))[0].reason
    assert bench.ask(goal(asks, RelativeMove(Vector3(-6, 0, 0))))[0].ok


async def test_a_geodetic_fence_and_goal_count_from_the_origin(make_bench, asks):
    origin = {"latitude": 47.0, "longitude": 8.0}
    corners = [(46.999, 7.999), (47.001, 7.999), (47.001, 8.001), (46.999, 8.001)]
    bench = make_bench(fence={"frame": "geodetic", "inclusion": [corners]}, origin=origin)
    tell(bench)
    assert bench.ask(goal(asks, GoTo(Goal(geo=GeoPoint(47.0009, 8.0)))))[0].ok
    tell(bench)
    assert not bench.ask(goal(asks, GoTo(Goal(geo=GeoPoint(47.0011, 8.0)))))[0].ok


async def test_without_an_origin_the_corners_are_placed_once_home_is_known(make_bench, asks):
    corners = [(46.999, 7.999), (47.001, 7.999), (47.001, 8.001), (46.999, 8.001)]
    bench = make_bench(fence={"frame": "geodetic", "inclusion": [corners]})
    tell(bench)
    assert "unknown" in bench.ask(goal(asks, GoTo(Goal(Vector3(5, 0, 0)))))[0].reason
    home = GeoPoint(47.0, 8.0, 400.0)
    bench.desk.guard.see(FlightControllerReport(0.0, armed=False, mode="", failsafe=False, home=home))
    assert bench.ask(goal(asks, GoTo(Goal(Vector3(5, 0, 0)))))[0].ok


async def test_a_velocity_is_held_only_as_far_as_it_keeps_the_fence(make_bench, asks):
    bench = make_bench(fence=FENCE)
    tell(bench)
    assert bench.ask(asks.setpoint(2.0))[0].ok
    assert bench.puppet.told[-1].linear.x == 2.0
    tell(bench, 18.0)
    await asks.settle()
    assert bench.puppet.told[-1] == "stop"
    assert bench.ask(asks.setpoint(2.0))[0].ok
    assert bench.puppet.told[-1] == ZERO_VELOCITY
    assert bench.ask(asks.setpoint(-1.0))[0].ok
    assert bench.puppet.told[-1].linear.x == -1.0


def lease_runs_out(bench, asks):
    bench.ask(asks.setpoint(1.0))
    bench.desk.deadman.expire(bench.desk.deadman.until)
    bench.desk.lease_ran_out()


def lease_runs_out_as_the_goal_comes(bench, asks):
    bench.ask(asks.setpoint(1.0))
    bench.desk.deadman.expire(bench.desk.deadman.until)


def is_refused(bench, asks):
    bench.puppet.raises = Refused("not today")
    bench.ask(asks.setpoint(1.0))


def makes_the_adapter_fail(bench, asks):
    bench.puppet.raises = ZeroDivisionError("oops")
    bench.ask(asks.setpoint(1.0))


@pytest.mark.parametrize(
    "ends", [lease_runs_out, lease_runs_out_as_the_goal_comes, is_refused, makes_the_adapter_fail]
)
async def test_a_velocity_that_has_ended_ends_no_goal_near_the_fence(make_bench, asks, ends):
    bench = make_bench(fence=FENCE)
    tell(bench)
    ends(bench, asks)
    bench.puppet.raises = None
    bench.ask(goal(asks, GoTo(Goal(Vector3(19, 0, 0)))))
    await asks.settle()
    tell(bench, 18.5)
    await asks.settle()
    assert bench.statuses()[-1] == "running"
    assert "stop" not in bench.puppet.told


async def test_a_velocity_is_refused_while_nobody_knows_where_the_robot_is(make_bench, asks):
    bench = make_bench(fence=FENCE)
    assert "unknown" in bench.ask(asks.setpoint(1.0))[0].reason
    tell(bench)
    bench.clock.advance(2.0)
    assert "unknown" in bench.ask(asks.setpoint(1.0))[0].reason


async def test_a_robot_blown_out_on_the_way_to_a_goal_is_stopped_and_told_once(make_bench, asks):
    bench = make_bench(fence=FENCE)
    tell(bench)
    bench.ask(goal(asks, GoTo(Goal(Vector3(10, 0, 0)))))
    await asks.settle()
    for x in (19.0, 22.0, 23.0):
        tell(bench, x)
    await asks.settle()
    assert bench.puppet.told[-1] == "stop"
    assert bench.reports[-1].message == "fence: it is outside the fence"
    assert bench.statuses()[-1] == "failed"
    assert len(told(bench, "fence_breached")) == 1


async def test_a_robot_that_somebody_else_flies_is_told_of_but_not_touched(make_bench, asks):
    bench = make_bench(fence=FENCE)
    tell(bench, 30.0)
    await asks.settle()
    assert bench.puppet.told == []
    assert told(bench, "fence_breached")


async def test_a_flight_does_not_begin_outside_or_with_too_little_battery(make_bench, asks):
    bench = make_bench(fence=FENCE, battery_policy=POLICY)
    tell(bench, 30.0)
    bench.desk.guard.see(BatteryReport(0.0, 90.0))
    assert bench.ask(asks.command("takeoff"))[0].reason == "it is outside the fence"
    tell(bench)
    bench.desk.guard.see(BatteryReport(0.0, 19.0))
    assert "19 %" in bench.ask(asks.command("takeoff"))[0].reason
    bench.desk.guard.see(BatteryReport(0.0, 90.0))
    bench.ask(asks.command("takeoff"))
    await asks.settle()
    assert bench.puppet.told == [("takeoff", None)]


async def test_a_goal_beyond_the_battery_is_refused(make_bench, asks):
    bench = make_bench(battery_policy=POLICY)
    tell(bench)
    bench.desk.guard.see(BatteryReport(0.0, 60.0))
    far, near = GoTo(Goal(Vector3(60, 0, 0))), GoTo(Goal(Vector3(30, 0, 0)))
    assert "the way there and home takes 60 %" in bench.ask(goal(asks, far))[0].reason  # 120 m at 2 m/s
    assert bench.ask(goal(asks, near))[0].ok


@pytest.mark.parametrize("before", [(), (14.0,)])
async def test_a_low_battery_is_acted_upon_once_while_we_move_the_robot_also_when_it_was_low_before(
    make_bench, asks, before
):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    for percent in before:
        bench.desk.guard.see(BatteryReport(0.0, percent))
    bench.ask(asks.setpoint(1.0))
    for percent in (16.0, 15.0, 14.0, 10.0, 5.0):
        bench.desk.guard.see(BatteryReport(0.0, percent))
        await asks.settle()
    assert bench.puppet.told.count("land") == 1
    assert len(told(bench, "battery_low")) == 1


async def test_a_low_battery_of_a_robot_that_is_not_ours_is_only_told(make_bench, asks):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.desk.guard.see(BatteryReport(0.0, 10.0))
    await asks.settle()
    assert bench.puppet.told == []
    assert told(bench, "battery_low")


async def test_a_low_battery_ends_no_emergency_stop_and_is_acted_upon_after_its_release(make_bench, asks):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.ask(asks.setpoint(1.0))
    bench.ask(asks.command("emergency_stop"))
    await asks.settle()
    bench.desk.guard.see(BatteryReport(0.0, 14.0))
    await asks.settle()
    assert told(bench, "battery_low")
    assert "land" not in bench.puppet.told
    bench.ask(asks.command("release_emergency_stop"))
    bench.desk.guard.see(BatteryReport(0.0, 14.0))
    await asks.settle()
    assert bench.puppet.told.count("land") == 1


async def test_a_low_battery_is_acted_upon_again_only_after_it_was_charged(make_bench, asks):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    lands = []
    for percent in (15.0, 15.1, 15.0, 17.0, 14.0, 90.0, 15.0):
        bench.ask(asks.setpoint(1.0))
        bench.desk.guard.see(BatteryReport(0.0, percent))
        await asks.settle()
        lands.append(bench.puppet.told.count("land"))
    assert lands == [1, 1, 1, 1, 1, 1, 2]
    assert len(told(bench, "battery_low")) == 2


async def test_an_action_that_could_not_be_asked_is_asked_with_the_next_look(make_bench, asks):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.ask(asks.setpoint(1.0))
    bench.desk.lost("no heartbeat")
    bench.desk.guard.see(BatteryReport(0.0, 14.0))
    assert "land" not in bench.puppet.told
    bench.desk.found()
    for percent in (14.0, 13.0):
        bench.desk.guard.see(BatteryReport(0.0, percent))
    await asks.settle()
    assert bench.puppet.told.count("land") == 1


async def test_a_landing_is_not_broken_off_for_a_low_battery_which_is_acted_upon_after_it(make_bench, asks):
    bench = make_bench(battery_policy={**POLICY, "action": "stop"})
    bench.puppet.land = bench.puppet.go.wait  # it takes its time
    landing = bench.ask(asks.command("land"), waits=True)
    await asks.settle()
    bench.desk.guard.see(BatteryReport(0.0, 14.0))
    await asks.settle()
    assert told(bench, "battery_low")
    assert bench.puppet.told == []
    bench.puppet.go.set()
    await asks.settle()
    assert landing[-1].done
    bench.desk.guard.see(BatteryReport(0.0, 13.0))
    await asks.settle()
    assert bench.puppet.told == ["stop"]


@pytest.mark.parametrize("kind", ["setpoint", "command", "goal", "zero"])
async def test_what_is_refused_because_a_pilot_has_the_robot_does_not_make_it_ours(make_bench, asks, kind):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.desk.guard.see(BatteryReport(0.0, 90.0))
    tell(bench)
    bench.ask(asks.setpoint())
    bench.desk.authority_lost("the pilot switched to POSHOLD")
    bench.puppet.raises = None if kind == "zero" else NotReady("a pilot has it")
    what = {"command": asks.command("takeoff"), "zero": asks.setpoint(0.0)}
    bench.ask(what[kind] if kind in what else getattr(asks, kind)())
    await asks.settle()
    bench.desk.guard.see(BatteryReport(0.0, 14.0))
    await asks.settle()
    assert told(bench, "battery_low")
    assert "land" not in bench.puppet.told


async def test_a_robot_that_obeyed_after_a_pilot_had_it_is_ours_again(make_bench, asks):
    bench = make_bench(battery_policy={**POLICY, "action": "land"})
    bench.desk.authority_lost("the pilot switched to POSHOLD")
    bench.ask(asks.setpoint())
    bench.desk.guard.see(BatteryReport(0.0, 14.0))
    await asks.settle()
    assert bench.puppet.told[-1] == "land"


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
    make_bench, asks, moved_to, percent, refusal
):
    bench = make_bench(fence={**FENCE, "exclusion": [WALL]}, battery_policy=POLICY)

    tell(bench)
    bench.desk.guard.see(BatteryReport(0.0, 90.0))
    bench.ask(goal(asks, GoTo(Goal(Vector3(8, 10, 0)))))
    await asks.settle()
    paused = bench.ask(Navigate(Control.PAUSE, "", asks.goal().origin))
    await asks.settle()
    assert paused[0].ok
    tell(bench, *moved_to)
    bench.desk.guard.see(BatteryReport(0.0, percent))
    await asks.settle()
    (answer,) = bench.ask(Navigate(Control.RESUME, "", asks.goal().origin))
    assert answer.ok is not bool(refusal)
    assert refusal in answer.reason
