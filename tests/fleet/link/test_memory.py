import pytest

from fleet.errors import LinkLost
from fleet.link.memory import MemoryRobot
from fleet.link.url import open_link


async def test_bytes_go_both_ways(receiver):
    heard = receiver()
    with MemoryRobot("both-ways", answer=bytes.upper) as robot:
        link = await open_link("memory:both-ways", heard)
        link.send(b"ping")
        await heard.until(b"PING")
        robot.say(b"!")
        await heard.until(b"PING!")
        assert robot.heard == [b"ping"]


async def test_an_unplugged_robot_is_noticed_and_can_come_back(receiver, loss_reason):
    with MemoryRobot("unplugged") as robot:
        link = await open_link("memory:unplugged", receiver())
        robot.unplug()
        assert await loss_reason(link) == "memory:unplugged: unplugged"
        with pytest.raises(LinkLost):
            link.send(b"x")
        await open_link("memory:unplugged", receiver())
        assert robot.opened == 2


async def test_a_closed_link_hears_nothing_more(receiver):
    heard = receiver()
    with MemoryRobot("closed") as robot:
        link = await open_link("memory:closed", heard)
        robot.say(b"under way")
        await link.close()
        await open_link("memory:closed", receiver())
    assert heard.pieces == []


async def test_a_robot_that_is_not_there_may_come(receiver):
    with pytest.raises(LinkLost, match="no robot of this name"):
        await open_link("memory:nobody", receiver())


async def test_a_name_is_taken_once():
    with MemoryRobot("twice"), pytest.raises(ValueError, match="taken"), MemoryRobot("twice"):
        pass
