import asyncio
import logging
import types

import pytest

from fleet.host.process.driverlog import publish_robot_logs


class Process:
    """What the log needs of a process, with a robot that collects what it is to publish."""

    def __init__(self):
        self.loop = asyncio.get_running_loop()
        self.lines = []
        self.robots = {"rex": types.SimpleNamespace(publish=self.lines.append)}


@pytest.fixture
async def process():
    process = Process()
    process.end = publish_robot_logs(process)
    yield process
    process.end()


async def test_a_robots_warnings_go_to_its_driverlog(process, requests):
    logging.getLogger("fleet.robot.rex").warning("the %s is hot", "motor")
    logging.getLogger("fleet.robot.rex").info("nothing to see")
    logging.getLogger("fleet.robot.max").warning("somebody else's")
    logging.getLogger("fleet.host").warning("the host's")
    await requests.settle()
    assert [(line.level, line.message) for line in process.lines] == [("WARNING", "the motor is hot")]


async def test_a_line_that_cannot_be_put_together_hurts_nobody(process, requests, monkeypatch):
    monkeypatch.setattr(logging, "raiseExceptions", False)
    record = logging.LogRecord("fleet.robot.rex", logging.WARNING, "x.py", 1, "%d", ("x",), None)
    logging.getLogger("fleet.robot").handlers[-1].handle(record)
    await requests.settle()
    assert process.lines == []


async def test_nothing_is_published_after_the_end(process, requests):
    process.end()
    logging.getLogger("fleet.robot.rex").warning("too late")
    await requests.settle()
    assert process.lines == []


def test_a_line_after_the_loop_was_closed_hurts_nobody(monkeypatch):
    monkeypatch.setattr(logging, "raiseExceptions", False)

    async def make():
        process = Process()
        return publish_robot_logs(process)

    end = asyncio.run(make())
    logging.getLogger("fleet.robot.rex").warning("the edge is gone")
    end()
