"""A halt while a command is not answered yet: what moves is not asked for again, a landing is."""

import asyncio
import math
import threading

import pytest

from fleet import Goal, GoTo, Refused, Vector3

COMMANDS = {"COMMAND_LONG", "COMMAND_INT"}
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
FAR = GoTo(Goal(position=Vector3(0.0, 60.0, 10.0)))
both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


async def consumed(steps):
    async for _ in steps:
        pass


def halted(it):
    """Halt as the watchdog does: from another thread, while the loop does nothing."""
    thread = threading.Thread(target=it.adapter.halt)
    thread.start()
    thread.join()


async def holds(it, mode):
    """Require that it holds from now on, though it hears everything."""
    it.deaf_to = set()
    await it.until(lambda: it.mode == mode and it.speed < 0.3, within=8.0)
    there = it.place
    for _ in range(50):
        assert it.mode == mode
        assert math.dist(it.place, there) < 1.0
        await asyncio.sleep(0.1)


async def unheard(it, doing, command, deaf_to=COMMANDS):
    """Let it be deaf until a command was sent to it once."""
    it.deaf_to, before = deaf_to, len(it.requested(command))
    task = asyncio.ensure_future(doing)
    await it.until(lambda: len(it.requested(command)) > before, within=5.0)
    return task


def test_a_rover_that_is_halted_is_not_sent_to_its_place_again(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            await it.wait_until_known()
            await it.do("arm")
            going = await unheard(it, consumed(it.adapter.navigate(FAR)), 192, {"COMMAND_INT"})
            halted(it)
            sent = len(it.requested(192))
            await holds(it, "HOLD")
            with pytest.raises(Refused, match="the robot was halted"):
                await going
            assert len(it.requested(192)) == sent

    run_in_sim_time(main())


@both
def test_a_multirotor_that_is_halted_is_not_sent_on_again_when_it_hears_the_repetition(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            await it.adapter.stop("hover")
            going = await unheard(
                it, consumed(it.adapter.navigate(FAR)), {"ardupilot": 176, "px4": 192}[flavour]
            )
            halted(it)
            await holds(it, HOLD[flavour])
            with pytest.raises(Refused, match="the robot was halted"):
                await going

    run_in_sim_time(main())


@both
def test_a_landing_that_is_not_answered_yet_goes_on_after_a_halt(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=5.0)
            coming = await unheard(it, it.do("land"), 176)
            halted(it)
            it.deaf_to = set()
            await coming
            assert not it.armed

    run_in_sim_time(main())


@both
def test_a_takeoff_during_a_landing_is_not_asked_for_again_after_a_halt_and_the_landing_goes_on(
    run_in_sim_time, sim_flight, flavour
):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            landing = asyncio.ensure_future(it.do("land"))
            await asyncio.sleep(3.0)
            mode, command = it.mode, {"ardupilot": 176, "px4": 22}[flavour]
            rising = await unheard(it, it.do("takeoff", altitude=15.0), command)
            halted(it)
            it.deaf_to = set()
            with pytest.raises(Refused, match="the robot was halted"):
                await rising
            await asyncio.sleep(2.0)
            assert it.mode == mode
            landing.cancel()

    run_in_sim_time(main())


@both
def test_a_hold_that_was_lost_with_the_halt_is_repeated(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with sim_flight(flavour) as it:
            await it.wait_until_known()
            await it.do("takeoff", altitude=10.0)
            await it.adapter.stop("hover")
            it.sim.faults["no_ack"] = 1.0
            going = asyncio.ensure_future(consumed(it.adapter.navigate(FAR)))
            await it.until(lambda: it.speed > 0.5, within=20.0)
            it.deaf_to = COMMANDS
            halted(it)
            await asyncio.sleep(0.5)
            await holds(it, HOLD[flavour])
            going.cancel()

    run_in_sim_time(main())
