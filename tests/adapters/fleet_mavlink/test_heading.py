"""The nose stays where it is unless a yaw is asked, whatever the autopilot's own habit."""

import asyncio
import math

import pytest

from fleet import FollowPath, Goal, GoTo, Refused, RelativeMove, TimedOut, Vector3, Velocity

HABITS = [("ardupilot", "WP_YAW_BEHAVIOR", value) for value in (0, 1, 2, 3)]
HABITS += [("px4", "MPC_YAW_MODE", value) for value in (0, 1, 2, 3, 4)]
both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
THERE_AND_BACK = [
    Vector3(-5.0, 0.0, 0.0),
    Vector3(5.0, 0.0, 0.0),
    Vector3(0.0, 5.0, 0.0),
    Vector3(0.0, -5.0, 0.0),
    Vector3(-3.0, 2.0, 1.0),
    Vector3(3.0, -2.0, -1.0),
]


class Nose:
    """How far the nose of a vehicle is from where it was, at the most, in radians."""

    def __init__(self, it):
        self._it = it
        self._began = it.sim.body.heading
        self.most = 0.0

    def look(self):
        turned = math.remainder(self._it.sim.body.heading - self._began, math.tau)
        self.most = max(self.most, abs(turned))


async def flown(it, task, nose):
    """Fly a task to its end, looking at the nose."""
    async for _ in it.adapter.navigate(task):
        nose.look()
    nose.look()


async def turned_to(it, degrees):
    """Take off, and turn the nose away from north."""
    await it.wait_until_known()
    await it.do("takeoff", altitude=6.0)
    await turns(it, degrees)


async def turns(it, degrees):
    """Turn the nose above its start."""
    goal = Goal(position=Vector3(0.0, 0.0, 6.0), yaw=math.radians(90.0 - degrees))
    async for _ in it.adapter.navigate(GoTo(goal)):
        pass


async def moves_by_distances(it, nose):
    """Move there and back along its own axes."""
    before = it.place
    for step in THERE_AND_BACK:
        await flown(it, RelativeMove(step), nose)
    assert it.place == pytest.approx(before, abs=1.0)


async def flies_to_goals(it, nose):
    """Fly to a goal and along a path without a yaw, and climb."""
    await flown(it, GoTo(Goal(position=Vector3(0.0, 8.0, 6.0))), nose)
    path = (Goal(position=Vector3(6.0, 0.0, 5.0)), Goal(position=Vector3(0.0, 0.0, 6.0)))
    await flown(it, FollowPath(path), nose)
    await it.do("ascend", distance=2.0)
    nose.look()


async def is_driven_sideways(it, nose):
    """Fly by a velocity of its body."""
    for _ in range(4):
        await it.drive(Velocity(Vector3(0.0, 1.5, 0.0)), 1.0)
        nose.look()
    await it.adapter.stop("hover")
    nose.look()


MOVES = ((60.0, moves_by_distances), (200.0, flies_to_goals), (120.0, is_driven_sideways))


@pytest.mark.parametrize(("flavour", "parameter", "value"), HABITS)
def test_whatever_is_flown_without_a_yaw_keeps_the_nose(
    run_in_sim_time, sim_flight, flavour, parameter, value
):
    async def main():
        async with sim_flight(flavour) as it:
            await turned_to(it, 60.0)
            await it.do("set_parameter", name=parameter, value=value, force=True)
            for degrees, moves in MOVES:
                await turns(it, degrees)
                nose = Nose(it)
                await moves(it, nose)
                assert nose.most < 0.1, moves.__name__

    run_in_sim_time(main())


@both
def test_a_path_keeps_the_yaw_that_its_last_goal_asked(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await turned_to(it, 0.0)
            goals = (
                Goal(position=Vector3(6.0, 0.0, 6.0), yaw=0.0),  # nose to the east
                Goal(position=Vector3(0.0, 6.0, 6.0)),
            )
            async for _ in it.adapter.navigate(FollowPath(goals)):
                pass
            assert math.degrees(it.sim.body.heading) % 360 == pytest.approx(90.0, abs=12)

    run_in_sim_time(main())


def test_a_place_that_is_lost_on_the_way_is_sent_again(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await turned_to(it, 60.0)
            nose = Nose(it)
            it.deaf_to.add("SET_POSITION_TARGET_GLOBAL_INT")
            moving = it.adapter.navigate(RelativeMove(Vector3(0.0, -6.0, 0.0)))
            first = asyncio.ensure_future(anext(moving))
            await it.until(lambda: it.ignored, within=5.0)
            it.deaf_to.clear()
            await first
            async for _ in moving:
                nose.look()
            assert nose.most < 0.1

    run_in_sim_time(main())


def test_a_place_that_the_autopilot_does_not_take_is_refused_and_not_flown(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await turned_to(it, 60.0)
            it.deaf_to.add("SET_POSITION_TARGET_GLOBAL_INT")
            before = it.place
            with pytest.raises(Refused, match="does not take the place"):
                await flown(it, RelativeMove(Vector3(6.0, 0.0, 0.0)), Nose(it))
            assert it.mode == "BRAKE"
            assert it.place == pytest.approx(before, abs=0.5)

    run_in_sim_time(main())


def test_an_autopilot_that_does_not_answer_to_a_place_is_not_called_unwilling(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot") as it:
            await turned_to(it, 60.0)
            it.deaf_to |= {"SET_POSITION_TARGET_GLOBAL_INT", "COMMAND_LONG"}
            with pytest.raises(TimedOut, match="did not say where it flies to"):
                await flown(it, RelativeMove(Vector3(6.0, 0.0, 0.0)), Nose(it))

    run_in_sim_time(main())
