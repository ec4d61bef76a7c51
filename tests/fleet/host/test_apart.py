"""Robots of one edge kept apart, in a field where nothing waits."""

import asyncio

from fleet.testing.clock import JumpingLoop
from tests.fleet.host.field import Field, Flyer


def in_field(starts, work, **site):
    """Run ``work(field)`` in time that jumps; return what it returns."""

    async def whole():
        async with Field(starts, **site).running() as field:
            return await work(field)

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


DRONES = {"drone-1": (Flyer, (0.0, 0.0, 0.0)), "drone-2": (Flyer, (0.0, 11.0, 0.0))}


def test_the_second_of_two_drones_that_are_sent_to_one_point_is_refused():
    async def work(field):
        first = field.send("drone-1", 10, 5, 5)
        second = field.send("drone-2", 10, 5, 5)
        await asyncio.sleep(20)
        return first, second, field.apart("drone-1", "drone-2")

    first, second, apart = in_field(DRONES, work)
    assert [answer.done for answer in first] == [None, True]
    assert not second[0].ok
    assert "goal 1 is 0.0 m from drone-1's way, 3.2 m are kept" in second[0].reason
    assert apart > 3.0
