"""One robot is led after another: near enough, never too near, and not once nobody knows where that is."""

import asyncio
import uuid

import pytest

from fleet.errors import Unsupported
from fleet.model.navigation import Control, FollowRobot, Navigate
from fleet.testing.clock import JumpingLoop
from tests.fleet.host.field import TELE, Field, Flyer, Walker


class Rover(Flyer):
    """One of a kind that moves any way, which tells once it is met that it does not move sideways."""

    async def connect(self):
        await super().connect()
        self.robot.lacks(dict.fromkeys(("strafe_left", "strafe_right"), "it moves along its nose only"))

    def drive(self, velocity):
        if abs(velocity.linear.y) > 0.01:
            raise Unsupported("it moves along its nose only")
        super().drive(velocity)


PAIR = {"ahead": (Walker, (4.0, 0.0, 0.0)), "behind": (Walker, (0.0, 3.0, 1.0))}
ABOVE = {"ahead": (Walker, (4.0, 0.0, 0.0)), "behind": (Flyer, (0.0, 3.0, 0.0))}
ALONG = {"ahead": (Walker, (4.0, 0.0, 0.0)), "behind": (Rover, (0.0, 3.0, 1.0))}


def in_field(starts, work):
    """Run ``work(field)`` in time that jumps; return what it returns."""

    async def whole():
        async with Field(starts).running() as field:
            return await work(field)

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


def follow(field, robot="ahead", distance=2.0):
    """Have the robot behind follow one; return the list that fills with the answers."""
    return field.request("behind", Navigate(FollowRobot(robot, distance), uuid.uuid4().hex, TELE))


def flat(field):
    """Return the metres between the two on the plane."""
    ahead, behind = (field.made[name].site for name in ("ahead", "behind"))
    return (ahead - behind).horizontal()


@pytest.mark.parametrize("starts", [PAIR, ABOVE, ALONG], ids=["drives", "flies", "along its nose"])
def test_it_keeps_its_distance_behind_one_that_goes_round(starts):
    async def work(field):
        answers, gaps = follow(field, distance=3.0), []
        await asyncio.sleep(8)
        for x, y in ((9, 0), (9, 5), (3, 5)):
            field.send("ahead", x, y)
            for _ in range(120):
                await asyncio.sleep(0.1)
                gaps.append(flat(field))
        await asyncio.sleep(10)
        return list(answers), gaps, flat(field), field.state("behind").activity

    answers, gaps, last, activity = in_field(starts, work)
    assert [(answer.ok, answer.done) for answer in answers] == [(True, None)], answers
    assert activity == "following ahead"
    assert min(gaps) > 1.9
    assert max(gaps) < 7.0
    assert last == pytest.approx(3.0, abs=0.5)


def test_one_that_is_near_enough_stands_and_is_not_led_back():
    async def work(field):
        follow(field, distance=20.0)
        before = field.made["behind"].site
        await asyncio.sleep(3)
        return (field.made["behind"].site - before).norm()

    assert in_field(PAIR, work) < 0.05


def test_it_stands_and_has_failed_once_the_other_one_is_lost():
    async def work(field):
        answers = follow(field)
        field.send("ahead", 20, 0)
        await asyncio.sleep(3)
        field.made["ahead"].silent = True
        await asyncio.sleep(1.5)
        moved = field.made["behind"].requested.linear.norm()
        await asyncio.sleep(2)
        return answers, moved, field.made["behind"].stops

    answers, moved, stops = in_field(PAIR, work)
    assert moved == 0.0, "it goes on towards a place that is too old"
    assert not answers[-1].ok
    assert "ahead has not reported its position for 2" in answers[-1].reason
    assert stops


@pytest.mark.parametrize(
    ("starts", "robot", "why"),
    [
        (PAIR, "nobody", "the position of nobody in the frame of behind is unknown"),
        (PAIR, "behind", "the position of behind in"),
        ({**PAIR, "behind": (Walker, {})}, "ahead", "behind is not placed in the site's frame"),
        ({**PAIR, "ahead": (Walker, {})}, "ahead", "the position of ahead in"),
    ],
)
def test_who_cannot_be_followed_is_refused_before_anything_moves(starts, robot, why):
    async def work(field):
        return follow(field, robot)

    (answer,) = in_field(starts, work)
    assert not answer.ok
    assert why in answer.reason


def test_its_own_fence_holds_while_it_follows():
    fenced = {"start": (0.0, 3.0, 0.0), "fence": {"inclusion": [[[-2, -9], [5, -9], [5, 9], [-2, 9]]]}}

    async def work(field):
        follow(field)
        field.send("ahead", 25, 0)
        farthest = 0.0
        for _ in range(250):
            await asyncio.sleep(0.1)
            farthest = max(farthest, field.made["behind"].site.x)
        return farthest

    assert 3.0 < in_field({**PAIR, "behind": (Walker, fenced)}, work) <= 5.0


def test_others_are_kept_apart_from_it_whatever_distance_was_asked_for():
    async def work(field):
        follow(field, distance=0.5)
        least = 99.0
        for _ in range(150):
            await asyncio.sleep(0.1)
            least = min(least, flat(field))
        return least

    assert in_field(PAIR, work) >= 0.8  # both radii


def test_it_is_paused_and_goes_on():
    async def work(field):
        follow(field)
        await asyncio.sleep(1)
        field.request("behind", Navigate(Control.PAUSE, "", TELE))
        await asyncio.sleep(2)
        paused = field.made["behind"].site, field.state("behind").activity
        await asyncio.sleep(2)
        stood = (field.made["behind"].site - paused[0]).norm()
        field.request("behind", Navigate(Control.RESUME, "", TELE))
        await asyncio.sleep(8)
        return stood, paused[1], flat(field)

    stood, activity, last = in_field(PAIR, work)
    assert stood < 0.05
    assert activity == "following ahead, paused"
    assert last == pytest.approx(2.0, abs=0.5)
