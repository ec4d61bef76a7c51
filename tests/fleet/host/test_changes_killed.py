"""An edge that is killed in the middle of a change: its next start has the whole new file, and every stop.

It runs in a process of its own, which kills itself (SIGKILL) at a named step, or is killed at any instant.
"""

import asyncio
import contextlib
import json
import random
import signal
import uuid

import msgspec
import pytest

from fleet.bus import keys
from fleet.config.difference import outline_of
from fleet.config.load import load
from fleet.host.edge.last_configuration import last_configuration
from fleet.model.change import ChangesRequest
from fleet.spool.state_folder import state_folder
from tests.fleet.host.mortal_edge import started

HERE = {"worker": "main"}
STEPS = (
    "fleet.host.edge.membership:_spec_of",
    "fleet.host.process.robot_process:RobotProcess.add",
    "fleet.host.edge.membership:RobotRegistrations.join",
    "fleet.host.process.robot_process:RobotProcess.serve",
    "fleet.host.edge.membership:RobotRegistrations.leave",
    "fleet.host.process.robot_process:RobotProcess.drop",
    "fleet.host.process.twin_holders:TwinHolders.give_up",
    "fleet.host.robot.local_robot:LocalRobot.configure",
    "fleet.host.edge.changes:ConfigurationChanges._apply_sections",
    "fleet.host.edge.last_configuration:create_folder",
)
"""Where the edge is killed: before a robot is built, known to stops, known to all, run, and so on."""


def changed(place):
    """Change all there is: a robot more, one less, one renamed and stopped, one rebuilt, and a section."""
    fleet = json.loads(place.file.read_text())
    rex, *rest = [robot for robot in fleet["robots"] if robot["name"] != "gone"]
    rest[0]["name"] = "maxine"
    rest[1]["stands"] = True
    rex["name"], added = "rex", rex | {"name": "ada", "twin": str(uuid.uuid4())}
    fleet["robots"] = [rex, *rest, added]
    fleet["groups"] = {"crew": ["rex", "ada", "maxine"]}
    place.file.write_text(json.dumps(fleet))


def killed(place, step, *, after=None):
    """Run the edge until it is killed in the middle of a change."""
    with contextlib.ExitStack() as stack:
        edge, ready = started(place.file, place.runtime, step)
        stack.callback(edge.kill)  # one that survived the step must not be waited for
        stack.enter_context(ready)
        assert ready.recv() == "ready"
        changed(place)
        session = place.bus_session()
        requested = msgspec.json.encode(ChangesRequest("apply"))
        ended = session.request(keys.changes(place.id), requested, timeout=30)
        if after is not None:
            edge.join(after)
            edge.kill()
        edge.join(60)
        assert edge.exitcode == -signal.SIGKILL
        session.close()
        list(ended)


async def begins_with_the_whole_new_file(place, run_edge, requests):
    edge = place.edge()
    folder = state_folder(place.id, edge._config.edge.spool.path)
    async with run_edge(edge):
        assert sorted(edge.process.robots) == ["ada", "max2", "maxine", "rex"]
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()), 30)
        stopped = {state.name for state in edge.states() if state.emergency_stop}
        assert stopped == {"maxine"}
        assert edge.process.robots["max2"].config.stands
        assert edge.state().groups == {"crew": ["rex", "ada", "maxine"]}
    last = last_configuration(folder)
    assert last.outline == outline_of(load(place.file)).digest(last.key.encode())


@pytest.fixture
def place(yard, tmp_path):
    made = yard(rex=HERE, max=HERE, max2=HERE, gone=HERE)
    made.change(edge={"spool": {"path": str(tmp_path / "state")}})
    return made


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.rpartition(":")[2])
async def test_killed_at_a_step_the_next_start_has_the_new_file_and_every_stop(
    place, run_edge, requests, step
):
    await asyncio.to_thread(killed, place, step)
    await begins_with_the_whole_new_file(place, run_edge, requests)


@pytest.mark.parametrize("number", range(3))
async def test_killed_at_any_instant_the_next_start_has_the_new_file_and_every_stop(
    place, run_edge, requests, number
):
    instant = random.Random(number).uniform(0.0, 0.4)
    await asyncio.to_thread(killed, place, "", after=instant)
    await begins_with_the_whole_new_file(place, run_edge, requests)
