"""Robots of one edge kept apart, in a field where nothing waits."""

import asyncio
import itertools
import random
import re

import pytest

from fleet.commands import command
from fleet.host.robot.battery_watch import BATTERY
from fleet.host.robot.robot_place import POSITION_UNKNOWN
from fleet.model.command import Command
from fleet.model.geometry import Velocity, rotate_to_world
from fleet.model.navigation import Progress
from fleet.model.report import FlightControllerReport
from fleet.testing.clock import JumpingLoop
from tests.fleet.host.field import STEP, Field, Flyer, Walker

DRONES = {"drone-1": (Flyer, (0.0, 0.0, 0.0)), "drone-2": (Flyer, (0.0, 11.0, 0.0))}
FACING = {"one": (Walker, (0.0, 0.0, 0.0)), "other": (Walker, (6.0, 0.0, 3.14159265))}


def in_field(starts, work, **site):
    """Run ``work(field)`` in time that jumps; return what it returns."""

    async def whole():
        async with Field(starts, **site).running() as field:
            return await work(field)

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


async def watch(field, seconds, each=lambda: None):
    """Let time pass; return the least distance of each pair, and what was told of the first."""
    least = {}
    causes = set()
    for step in range(int(seconds / STEP)):
        if step % 5 == 0:
            each()
        await asyncio.sleep(STEP)
        for pair in itertools.combinations(field.robots, 2):
            least[pair] = min(least.get(pair, 1e9), field.apart(*pair))
        if step % 5 == 4:  # a pose later: no cause lasts for less
            causes |= {field.state(name).cause.partition(":")[0] for name in field.robots}
    return least, causes - {""}


def test_the_second_of_two_drones_that_are_sent_to_one_point_is_refused():
    async def work(field):
        first = field.send("drone-1", 10, 5, 5)
        second = field.send("drone-2", 10, 5, 5)
        least, _ = await watch(field, 20)
        return first, second, least["drone-1", "drone-2"]

    first, second, least = in_field(DRONES, work)
    assert [answer.done for answer in first] == [None, True]
    assert not second[0].ok
    assert second[0].reason == "goal 1 is 0.0 m from drone-1's way, 3.2 m are kept"
    assert least > 3.0


def test_a_straight_way_that_crosses_anothers_is_refused_until_that_is_done():
    async def work(field):
        field.send("drone-1", 20, 11, 5)
        second = field.send("drone-2", 20, 0, 5)
        await asyncio.sleep(20)
        return second, field.send("drone-2", 10, 0, 5)

    crossing, later = in_field(DRONES, work)
    assert "the straight way to goal 1 is" in crossing[0].reason
    assert later[0].ok


def test_two_that_are_driven_into_each_other_are_slowed_then_held_before_their_radii_touch():
    async def work(field):
        def drive():
            field.drive("one", 1.0)
            field.drive("other", 1.0)

        least, causes = await watch(field, 12, drive)
        return least["one", "other"], causes, field.state("one")

    least, causes, state = in_field(FACING, work)
    assert 0.8 <= least < 1.2
    assert causes == {"slowed", "held"}
    assert state.health == "degraded"
    assert re.fullmatch(r"held: [01]\.\d m from other, closing", state.cause)


def test_what_increases_the_distance_always_passes():
    async def work(field):
        await watch(field, 12, lambda: field.drive("one", 1.0))
        near = field.apart("one", "other")
        await watch(field, 2, lambda: field.drive("one", -1.0))
        return near, field.apart("one", "other"), field.state("one").cause

    near, far, cause = in_field(FACING, work)
    assert near < 1.1
    assert far > near + 1.0
    assert cause == ""


def test_one_that_is_held_goes_on_when_the_other_has_gone():
    async def work(field):
        goal = field.send("one", 3, 0)
        await watch(field, 1)
        await watch(field, 6, lambda: field.drive("other", 1.0))
        held = field.apart("one", "other")
        await watch(field, 5, lambda: field.drive("other", -1.0))
        return goal, held

    goal, held = in_field(FACING, work)
    assert held >= 0.8
    assert goal[-1].done


def test_a_drone_whose_way_is_entered_is_held_and_its_goal_fails_with_the_cause():
    starts = {"drone-1": (Flyer, (0.0, 0.0, 0.0)), "drone-2": (Flyer, (15.0, -12.0, 0.0))}

    async def work(field):
        goal = field.send("drone-1", 40, 0)
        least, causes = await watch(field, 12, lambda: field.drive("drone-2", y=1.4))
        return goal, least["drone-1", "drone-2"], causes

    goal, least, causes = in_field(starts, work)
    assert least >= 3.0
    assert "held" in causes
    assert goal[-1].reason.startswith("held: ")
    assert goal[-1].reason.endswith("m from drone-2, closing")


def test_a_stop_always_passes():
    async def work(field):
        await watch(field, 12, lambda: field.drive("one", 1.0))
        stops = field.command("one", "stop"), field.command("one", "emergency_stop")
        await asyncio.sleep(1.0)
        return stops

    for answers in in_field(FACING, work):
        assert answers[0].ok


def test_a_robot_that_is_not_placed_is_unknown_to_the_others_and_never_clear():
    starts = {"one": (Walker, (0.0, 0.0, 0.0)), "lost": (Walker, {})}

    async def work(field):
        return field.state("one"), field.state("lost")

    one, lost = in_field(starts, work)
    assert one.separation == "unknown to lost"
    assert lost.separation == "unknown: it is not placed"
    assert (lost.site, one.site.x) == (None, 0.0)


def test_a_robot_that_fell_silent_stays_where_it_was_and_grows_by_how_far_it_may_have_gone():
    async def work(field):
        await watch(field, 2, lambda: field.drive("other", 1.0))
        field.made["other"].silent = True
        await asyncio.sleep(1.5)
        beside = field.send("one", 2.6, 0)
        field.command("one", "stop")
        await asyncio.sleep(8.5)
        return beside, field.send("one", -3.0, 0)

    beside, away = in_field(FACING, work)
    assert "from other, " in beside[0].reason
    assert "other has not reported its position for" in beside[0].reason
    assert away[0].ok


def test_an_odometry_that_began_anew_makes_the_place_unknown_and_leaves_the_robot_in_the_way():
    async def work(field):
        await watch(field, 6, lambda: field.drive("other", -1.0))
        field.made["other"].world = field.made["other"].world.scaled(0.0)
        await asyncio.sleep(1.0)
        return field.state("other"), field.state("one"), field.send("one", *_place(field, "other"))

    state, one, onto = in_field(FACING, work)
    assert one.separation == "unknown to other"
    assert "its position jumped by" in state.separation
    assert not onto[0].ok


def _place(field, name):
    site = field.made[name].site
    return site.x, site.y


def test_a_take_off_below_another_is_refused():
    async def work(field):
        field.send("drone-2", 0, 1, 8)
        await asyncio.sleep(20)
        return field.command("drone-1", "takeoff", altitude=10.0)

    answers = in_field(DRONES, work)
    assert "is 1.0 m from drone-2" in answers[0].reason


@pytest.mark.parametrize(("others", "taken"), [((), True), (("drone-2",), False)])
def test_a_robot_that_does_not_tell_where_it_is_begins_only_where_it_has_nobody_to_meet(others, taken):
    async def work(field):
        await asyncio.sleep(1.0)
        field.made["drone-1"].silent = True
        await asyncio.sleep(10.0)
        return field.command("drone-1", "takeoff", altitude=10.0)

    starts = {name: DRONES[name] for name in ("drone-1", *others)}
    answers = in_field(starts, work)
    assert answers[0].ok is taken
    assert taken or answers[0].reason == POSITION_UNKNOWN


def test_a_hundred_velocities_a_second_are_looked_at_ten_times_a_second():
    looks = []

    async def work(field):
        near = field.traffic.near
        field.traffic.near = lambda *given: looks.append(1) or near(*given)
        for _ in range(100):
            field.drive("one", -0.5)
            await asyncio.sleep(0.01)
        return len(looks)

    assert in_field(FACING, work) <= 12


SORTS = {
    "drone-1": (Flyer, (0.0, 0.0, 0.0)),
    "drone-2": (Flyer, (0.0, 8.0, 0.0)),
    "drone-3": (Flyer, (8.0, 0.0, 1.57)),
    "rover-1": (Walker, (3.0, 3.0, 0.5)),
    "rover-2": (Walker, (5.0, 5.0, 2.0)),
    "rover-3": (Walker, (-3.0, -3.0, -2.0)),
}
RADII = {Walker: 0.4, Flyer: 1.5}


@pytest.mark.parametrize("seed", [0, 1, 2, 11])  # in 11 one accelerates while it turns
def test_whatever_is_asked_of_many_no_two_come_nearer_than_their_radii(seed):
    rng = random.Random(seed)
    driven = {}

    def anything(field):
        name = rng.choice(list(field.robots))
        x, y = rng.uniform(-8, 12), rng.uniform(-8, 12)
        driven.pop(name, None)
        match rng.randrange(8):
            case 0 | 1 | 2 | 3:
                field.send(name, x, y)
            case 4 | 5 | 6:
                driven[name] = rng.uniform(-3, 3), rng.uniform(-1, 1), rng.uniform(-1, 1)
            case _:
                field.command(name, "stop")

    async def work(field):
        def each():
            if rng.random() < 0.12:
                anything(field)
            for name, velocity in driven.items():
                field.drive(name, *velocity)

        least, causes = await watch(field, 60, each)
        return least, causes

    least, causes = in_field(SORTS, work)
    near = {
        pair: (round(metres, 3), RADII[SORTS[pair[0]][0]] + RADII[SORTS[pair[1]][0]])
        for pair, metres in least.items()
        if metres < RADII[SORTS[pair[0]][0]] + RADII[SORTS[pair[1]][0]]
    }
    assert near == {}
    assert {"held", "slowed"} <= causes  # else nothing was tried


ABOVE = {"high": (Flyer, (0.0, 0.0, 0.0)), "low": (Flyer, (12.0, 0.0, 0.0))}


def test_a_landing_on_another_robot_is_reported_and_never_refused_and_others_keep_out_of_its_way():
    async def work(field):
        said = []
        field.robots["high"].controller.event_reporter._publish = said.append
        field.send("high", 0, 0, 10)
        await asyncio.sleep(15)
        field.send("low", 0, 2, 1)
        await asyncio.sleep(15)
        landing = field.command("high", "land")
        await asyncio.sleep(1)
        reasons = [report.fields["reason"] for report in said if getattr(report, "type", "") == "separation"]
        field.send("low", 12, 0, 1)
        await asyncio.sleep(8)
        return landing, reasons

    landing, reasons = in_field(ABOVE, work)
    assert landing[0].ok
    assert len(reasons) == 1
    assert reasons[0].startswith("land: ")
    assert "low" in reasons[0]
    assert reasons[0].endswith("it is let through all the same")


def test_who_would_be_sent_under_a_robot_that_lands_is_refused_until_it_is_down():
    async def work(field):
        field.send("high", 0, 0, 20)
        await asyncio.sleep(25)
        landing = field.command("high", "land")
        await asyncio.sleep(1)
        under = field.send("low", 0, 0, 2)
        await asyncio.sleep(30)
        beside = field.send("low", 5, 0, 0)
        await asyncio.sleep(8)
        return landing, under, beside

    landing, under, beside = in_field(ABOVE, work)
    assert [answer.done for answer in landing] == [None, True]
    assert not under[0].ok
    assert "high's way" in under[0].reason
    assert beside[0].ok


class Homing(Walker):
    """One that drives home by itself."""

    @command("return_to_home", timeout=60, safe=True)
    async def return_to_home(self):
        """Drive home."""
        while self.world.horizontal() > 0.3:
            self.requested = Velocity(rotate_to_world(self.world.scaled(-0.5 / self.world.norm()), -self.yaw))
            yield Progress(50.0)
            await asyncio.sleep(0.1)


WAY_HOME = {"rover": (Homing, (0.0, 0.0, 0.0)), "other": (Walker, (3.0, 5.0, 0.0))}


async def away(field, in_the_way):
    """Send the rover away from its home, and another on the way back."""
    field.send("rover", 6, 0)
    await asyncio.sleep(12)
    if in_the_way:
        field.send("other", 3, 0)
        await asyncio.sleep(12)


@pytest.mark.parametrize("in_the_way", [True, False])
def test_a_robot_that_would_drive_home_into_another_is_refused_in_words(in_the_way):
    async def work(field):
        await away(field, in_the_way)
        answers = field.command("rover", "return_to_home")
        await asyncio.sleep(1)
        return answers

    answers = in_field(WAY_HOME, work)
    assert answers[0].ok is not in_the_way
    assert not in_the_way or re.fullmatch(
        r"its way home is not free: the straight way to goal 1 is 0\.\d m from other.*", answers[0].reason
    )


def test_a_way_home_for_the_sake_of_the_battery_is_never_refused():
    async def work(field):
        await away(field, in_the_way=True)
        return field.request("rover", Command("return_to_home", origin=BATTERY))

    assert in_field(WAY_HOME, work)[0].ok


def test_asking_whether_a_landing_would_be_taken_tells_of_none():
    async def work(field):
        field.send("drone-1", 0, 5, 6)
        await asyncio.sleep(12)
        field.send("drone-2", 0, 5, 1)
        await asyncio.sleep(12)
        events = []
        field.robots["drone-1"].controller.guard._event_reporter.event = lambda *given, **_more: (
            events.append(given)
        )
        field.robots["drone-1"].describe()
        return events

    assert in_field(DRONES, work) == []


def test_what_circles_takes_up_its_circle_and_on_the_ground_nothing_of_it():
    starts = {"drone-1": (Flyer, (0.0, 0.0, 0.0)), "drone-2": (Flyer, (0.0, 60.0, 0.0))}

    async def work(field):
        guard = field.robots["drone-2"].controller.guard
        guard.circles(20.0)
        parked = field.send("drone-1", 0, 30, 5)
        await asyncio.sleep(20)
        guard.observe(FlightControllerReport(0.0, armed=True, mode="", failsafe=False))
        near = field.send("drone-1", 0, 40, 5)
        goal = field.send("drone-2", 0, 50, 5)
        return parked, near, goal

    parked, near, goal = in_field(starts, work)
    assert parked[0].ok
    assert "43.2 m are kept" in near[0].reason, "both radii, and twice the circle"
    assert "23.2 m are kept" in goal[0].reason, "both radii, and the circle about its goal"
