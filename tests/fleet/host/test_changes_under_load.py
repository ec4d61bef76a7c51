"""Random changes of a fleet that reports and is driven: who is not changed loses no message and no lease.

A few robots and changes here; ``--soak`` has 50 robots that report ten times a second, and 100 changes.
"""

import asyncio
import itertools
import json
import random
import uuid

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.bus import join
from fleet.bus.settings import BusSettings
from fleet.model.change import ChangeKind, ChangesAnswer, ChangesRequest, Outcome
from fleet.model.command import Transport
from fleet.model.report import PoseReport
from fleet.wire.databus import decode_report
from fleet.wire.topics import data_key

COUNTER = '''
"""A robot that counts in its pose, and writes down when it begins and when its motion ends."""
from typing import Literal
import fleet


class CounterConfig(fleet.AdapterConfig):
    adapter: Literal["counter"]
    journal: str


class Counter(fleet.Adapter[CounterConfig]):
    Config = CounterConfig
    limits = fleet.Limits(speed=2.0, yaw_rate=1.0)
    failsafe = "it moves nothing"

    def note(self, word):
        with open(self.config.journal, "a") as journal:
            journal.write(f"{self.config.name} {word}\\n")

    async def connect(self):
        self.note("run")
        self.number = 0
        self.robot.every(0.1, self.tell)

    def tell(self):
        self.number += 1
        at = fleet.Vector3(float(self.number), 0.0, 0.0)
        self.robot.report(fleet.PoseReport(0.0, at, fleet.quaternion_from_yaw(0.0)))

    def drive(self, velocity):
        if velocity.is_zero:
            self.note("stands")

    async def stop(self, reason):
        self.note("stop")

    def halt(self):
        self.note("halt")
'''
MOVE = b'{"command": "move_forward", "data": {"linear_x": 0.2}}'
FORMS = (
    lambda dice: {"max_age": dice.uniform(0.3, 0.9)},
    lambda dice: {"command_max_age": dice.uniform(3, 9)},
    lambda dice: {"limits": {"speed": dice.uniform(0.5, 2.0)}},
    lambda dice: {"accepts": {"command": dice.choice([["tele"], ["tele", "edge"], []])}},
)


class Load:
    """The edge under load: a third of its robots is driven all the time."""

    def __init__(self, place, edge, dice):
        self.place, self.edge, self.dice = place, edge, dice
        self.names = list(edge.process.robots)
        self.driven = set(self.names[::3])
        self.heard = {name: [] for name in self.names}
        self.done = []

    async def drive(self):
        while True:
            for name in self.driven:
                take = self.edge.process.robots[name].read("command", MOVE, transport=Transport.BUS)
                take(lambda _reply: None)
            await asyncio.sleep(0.1)

    def hear(self, session):
        for name, robot in self.edge.process.robots.items():

            def on_pose(_key, payload, heard=self.heard[name]):
                heard.append(decode_report(PoseReport.channel, payload).position.x)

            session.subscribe(data_key(robot.twin, PoseReport.channel), on_pose)

    def change_some(self, number):
        """Change robots at random; one more is added, or taken out again."""
        fleet = json.loads(self.place.file.read_text())
        for entry in self.dice.sample(fleet["robots"], number):
            entry.update(self.dice.choice(FORMS)(self.dice))
        self.come_and_go(fleet["robots"])
        self.place.file.write_text(json.dumps(fleet))

    def come_and_go(self, robots):
        guests = [entry for entry in robots if entry["name"] not in self.names]
        what = self.dice.choice(["add", "remove"]) if guests else "add"
        self.done.append(what)
        name = f"guest{len(self.done)}"
        if what == "add":
            robots.append(robots[0] | {"name": name, "twin": str(uuid.uuid4()), "limits": {"speed": 1.0}})
        else:
            robots.remove(guests[0])

    def words(self, name):
        lines = self.place.journal.read_text().splitlines()
        return [line.partition(" ")[2] for line in lines if line.startswith(f"{name} ")]


@pytest.fixture
def load_of(yard):
    def make(number):
        place = yard(**{f"r{index}": {"worker": "main", "setpoint_lease": 5.0} for index in range(number)})
        (place.file.parent / "plugins" / "toy.py").unlink()
        (place.file.parent / "plugins" / "counter.py").write_text(COUNTER)
        fleet = json.loads(place.file.read_text())
        fleet["robots"] = [entry | {"adapter": "counter"} for entry in fleet["robots"]]
        place.file.write_text(json.dumps(fleet))
        return place

    return make


async def test_robots_that_are_not_changed_lose_no_message_and_no_lease(load_of, run_edge, requests, request):
    robots, rounds, each = (50, 25, 3) if request.config.getoption("--soak") else (9, 4, 2)
    place = load_of(robots)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()), 60)
        bus = await asyncio.to_thread(join, BusSettings(place.id), place.runtime)
        load = Load(place, edge, random.Random(7))
        load.hear(bus.reports)
        driving = asyncio.create_task(load.drive())
        await requests.until(
            lambda: all(edge.process.robots[name].controller.in_motion for name in load.driven)
        )
        await requests.until(lambda: all(load.heard.values()), 60)
        done = []
        for _ in range(rounds):
            load.change_some(each)
            done += await apply(bus.control, place)
        rebuilt = {change.name for change in done if change.outcome is Outcome.DONE and is_rebuilt(change)}
        untouched = set(load.names) - rebuilt
        assert not rebuilt & load.driven
        for name in untouched:
            assert load.words(name).count("run") == 1
            assert all(later - sooner == 1 for sooner, later in itertools.pairwise(load.heard[name])), name
        assert all(set(load.words(name)) == {"run"} for name in load.driven)
        assert rebuilt
        kinds = {"add": ChangeKind.ADDED, "remove": ChangeKind.REMOVED}
        came = [change for change in done if change.kind in kinds.values()]
        assert [change.kind for change in came] == [kinds[what] for what in load.done]
        assert {change.outcome for change in came} == {Outcome.DONE}
        assert {change.outcome for change in done} >= {Outcome.DONE}
        assert {change.outcome for change in done if change.name in load.driven} & {
            Outcome.REFUSED,
            Outcome.PARTLY,
        }
        driving.cancel()
        await asyncio.to_thread(bus.reports.close)
        await asyncio.to_thread(bus.control.close)


def is_rebuilt(change):
    return change.kind is ChangeKind.REBUILT


async def apply(control, place):
    """Apply; return what came of what has changed."""

    def request():
        payload = msgspec.json.encode(ChangesRequest("apply"))
        return [data for _, data in control.request(keys.changes(place.id), payload, timeout=200)]

    (answer,) = await asyncio.to_thread(request)
    answer = msgspec.json.decode(answer, type=ChangesAnswer)
    assert answer.refusal == ""
    return [change for change in answer.changes if change.kind is not ChangeKind.UNTOUCHED]
