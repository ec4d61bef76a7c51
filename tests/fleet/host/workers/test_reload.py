"""A changed drop-in file is taken into use while its robots rest, and never under one that moves."""

import asyncio
import json
import re

import msgspec
import pytest

from fleet.bus import keys
from fleet.model.command import Reply

GOTO = {"command": "goto", "position": [1.0, 2.0, 0.0], "action_id": "a1"}


class Field:
    """A running edge: arm and leg in one worker, rex in the edge's process."""

    def __init__(self, place, edge, bus_session, requests):
        self.place, self.edge, self.bus_session, self._requests = place, edge, bus_session, requests
        self.file = place.file.parent / "plugins" / "toy.py"

    async def reload(self, adapter="toy", worker="limbs"):
        def request():
            key = keys.reload(self.place.id, worker)
            answers = self.bus_session.request(key, adapter.encode(), timeout=60)
            return [msgspec.json.decode(answer, type=Reply) for _, answer in answers]

        (reply,) = await asyncio.to_thread(request)
        return reply

    async def say(self, robot, message, kind="command"):
        def request():
            key, payload = keys.command(self.place.id, robot), json.dumps(message).encode()
            list(self.bus_session.request(key, payload, timeout=60, parameters={"kind": kind}))

        await asyncio.to_thread(request)

    def change(self, old, new):
        text = self.file.read_text()
        assert old in text, old
        self.file.write_text(text.replace(old, new))

    async def until(self, condition):
        await self._requests.until(condition)

    def state(self, robot):
        return next(state for state in self.edge.states() if state.name == robot)


@pytest.fixture
async def field(yard, run_edge, requests):
    place = yard(arm={"worker": "limbs"}, leg={"worker": "limbs"}, rex={"worker": "main"})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        yield Field(place, edge, bus_session, requests)
        await asyncio.to_thread(bus_session.close)


UNUSABLE = (
    ("class Toy", "class Toy(", r"toy\.py: .*SyntaxError|toy\.py: .*syntax"),
    ('Literal["toy"]', 'Literal["other"]', r"toy\.py: it has no adapter 'toy' any more"),
    ("journal: str", "journal: int", r"arm: the changed file refuses its config: journal: must"),
)


async def test_it_is_refused_for_a_file_that_cannot_be_used_and_while_a_robot_of_the_worker_is_commanded(
    field, fleet
):
    for old, new, expected in UNUSABLE:
        field.change(old, new)
        reply = await field.reload()
        assert not reply.ok
        assert re.search(expected, reply.reason), reply.reason
        assert len(field.place.processes("arm")) == 1
        assert field.state("arm").health == "ok"
        field.change(new, old)
    await field.say("leg", GOTO, kind="navigate")
    await field.until(lambda: "navigate" in field.place.words("leg"))
    reply = await field.reload()
    assert not reply.ok
    assert re.match(r"leg is commanded \(.+\); stop it first", reply.reason)
    assert len(field.place.processes("leg")) == 1
    await a_person_learns_why_it_is_refused(field, fleet)
    await field.say("leg", {"command": "stop"})
    await field.until(lambda: field.state("leg").activity == "")
    assert (await field.reload()).ok


async def a_person_learns_why_it_is_refused(field, fleet):
    code, out, err = await fleet("adapters", "reload", "toy", "-f", str(field.place.file))
    assert (code, out) == (5, "")
    assert "worker limbs: not reloaded: leg is commanded" in err
    assert "rex: no drop-in file in a worker runs it; end fleet run and start it again" in err
    code, _, err = await fleet("adapters", "reload", "toi", "-f", str(field.place.file))
    assert code == 5
    assert "no running robot has the adapter 'toi'" in err
    reply = await field.reload("lawnmower")
    assert reply.reason == "worker limbs runs no drop-in file with the adapter 'lawnmower'"


async def test_a_changed_file_is_in_use_after_it_the_edge_runs_on_and_an_emergency_stop_outlives_it(
    field, fleet
):
    await field.say("arm", {"command": "emergency_stop"})
    await field.until(lambda: field.state("arm").emergency_stop)
    (before,) = field.place.processes("arm")
    field.change('self.note("run")', 'self.note("run"); self.note("changed")')
    code, out, _ = await fleet("adapters", "reload", "toy", "-f", str(field.place.file))
    assert (code, out) == (7, "worker limbs: reloaded; running again: arm, leg\n")  # 7: rex has no worker
    await field.until(lambda: len(field.place.processes("arm")) == 2)
    await field.until(lambda: all(state.health == "ok" for state in field.edge.states()))
    assert field.place.processes("arm")[-1] != before
    assert "changed" in field.place.words("arm")
    assert len(field.place.processes("rex")) == 1
    assert field.state("arm").emergency_stop
