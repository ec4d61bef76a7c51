"""Stricter settings reach the robots of a worker at once; what is looser waits until they rest."""

import json

import msgspec
import pytest

from fleet.bus import keys
from fleet.model.change import HeldRobot, HoldRequest, HoldRobot, Outcome
from fleet.model.command import Reply
from tests.fleet.host.edge.test_changes import GOTO, HERE, moves, running

LIMBS = {"worker": "limbs"}


@pytest.fixture
async def field(yard, run_edge, requests):
    async with running(yard, run_edge, requests, arm=LIMBS, leg=LIMBS, rex=HERE) as there:
        yield there


async def test_what_is_stricter_reaches_a_robot_that_moves_and_its_worker_goes_on(field):
    await moves(field, "arm")
    field.write("arm", limits={"speed": 0.5, "yaw_rate": 9.0}, accepts={"command": []})
    done = (await field.apply())["arm"]
    assert (done.outcome, "arm is commanded" in done.why) == (Outcome.PARTLY, True)
    refused = await field.say("arm", {"command": "walk", "source_type": "tele"})
    assert "accepts no source_type" in refused.reason
    assert field.place.words("arm") == ["run", "navigate"]
    config = field.edge.remote["arm"].config
    assert (config.limits.speed, config.limits.yaw_rate) == (0.5, 1.0)
    a_worker_that_dies_now_would_come_up_with_what_it_was_held_to(field)
    assert (await field.say("arm", {"command": "stop"})).ok
    await field.until(lambda: field.state("arm").activity == "")
    assert (await field.apply())["arm"].outcome is Outcome.DONE
    assert field.edge.remote["arm"].config.limits.yaw_rate == 9.0
    assert (await field.request()).same
    await looser_settings_at_rest_and_stricter_ones_in_motion_are_done_without_a_restart(field)


def a_worker_that_dies_now_would_come_up_with_what_it_was_held_to(field):
    task = json.loads(field.edge._workers.managers["limbs"]._task)
    (given,) = [json.loads(robot["given"]) for robot in task["robots"] if robot["name"] == "arm"]
    assert given["accepts"]["command"] == []
    assert (given["limits"]["speed"], given["limits"]["yaw_rate"]) == (0.5, 1.0)


async def looser_settings_at_rest_and_stricter_ones_in_motion_are_done_without_a_restart(field):
    await field.until(lambda: all(field.state(name).health == "ok" for name in ("arm", "leg")))
    runs = field.place.processes("arm"), field.place.processes("leg")
    field.write("arm", accepts={"command": ["tele", "edit"]})
    assert (await field.apply())["arm"].outcome is Outcome.DONE
    assert (field.place.processes("arm"), field.place.processes("leg")) == runs
    assert (await field.say("arm", GOTO | {"action_id": "a2"}, "navigate")).ok
    await field.until(lambda: field.place.words("arm")[-1] == "navigate")
    field.write("arm", accepts={"command": [], "navigate": []})
    assert (await field.apply())["arm"].outcome is Outcome.DONE
    assert (field.place.processes("arm"), field.place.words("arm")[-1]) == (runs[0], "navigate")
    assert (await field.request()).same


async def test_a_worker_answers_for_each_robot_and_a_stop_finds_a_group_that_came_while_it_runs(field):
    await answers_for_each_robot_and_refuses_what_it_cannot_use(field)
    field.place.change(groups={"crew": ["arm", "rex"]})
    assert (await field.apply())["groups"].outcome is Outcome.DONE
    assert field.edge.state().groups == {"crew": ["arm", "rex"]}
    field.edge.remote["arm"].stop_later = lambda _cause: None  # the worker finds it by itself
    field.bus_session.put(keys.stop(field.place.id), b'["crew"]', urgent=True)
    await field.until(lambda: field.state("arm").emergency_stop and field.state("rex").emergency_stop)
    assert not field.state("leg").emergency_stop
    assert json.loads(field.edge._workers.managers["limbs"]._task)["groups"] == {"crew": ["arm", "rex"]}
    field.place.change(groups={})
    assert (await field.apply())["groups"].outcome is Outcome.DONE
    assert field.edge.state().groups == {}


async def answers_for_each_robot_and_refuses_what_it_cannot_use(field):
    requested = HoldRequest({"arm": HoldRobot('{"name": 1}'), "nobody": HoldRobot("{}")})
    key = keys.hold(field.place.id, "limbs")
    ((_, answer),) = field.bus_session.request(key, msgspec.json.encode(requested), timeout=20)
    held = msgspec.json.decode(answer, type=dict[str, HeldRobot])
    assert "its adapter, as it is loaded, refuses it" in held["arm"].why
    assert "has no robot 'nobody'" in held["nobody"].why
    assert list(field.bus_session.request(key, b"{", timeout=20)) == []
    reply = await field.say("arm", {"command": "walk"})
    assert isinstance(reply, Reply)
    assert reply.ok
