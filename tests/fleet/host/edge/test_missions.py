"""The missions of an edge follow its robots, its file and its stops, and are kept apart from other edges."""

import asyncio
import json
from types import SimpleNamespace

import pytest

from fleet.bus import keys
from fleet.config.load import Loaded
from fleet.config.schema import FleetConfig
from fleet.host.edge.missions import POLL_INTERVAL, Missions
from fleet.host.requests.stop_cause import local_cause
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.missions.results import EVERY
from fleet.model.command import Origin, Transport
from fleet.model.event import EventKind, EventReport
from fleet.plugins.registry import Plugin, Registry
from fleet.testing.clock import ManualClock
from tests.fleet.host.field import Walker, WalkerConfig, local_robot
from tests.tools.waiting import wait_until

PARTNERS = {"barn": {"robots": ["tom"]}}
ANNA = Origin(Transport.BUS, "tele", "anna")


class Bus:
    """A session that keeps what is declared and put on it."""

    def __init__(self):
        self.answers, self.subscriptions, self.puts = [], {}, []

    def declare_queryable(self, key, _call, *, more=""):
        self.answers.append(key)

    def subscribe_many(self, pattern, calls):
        self.subscriptions[pattern] = calls

    def put(self, key, payload, *, urgent=False):
        self.puts.append((key, payload, urgent))

    def publishers(self, _pattern):
        return None


def config_of(name, **fields):
    number = sum(name.encode())
    accepts = {"command": ["tele"], "mission": ["tele", "edit"], "navigate": ["tele"]}
    return WalkerConfig(name=name, twin=f"6f0c9a1e-0000-4000-8000-{number:012}", accepts=accepts, **fields)


def loaded_of(folder, *robots, **sections):
    config = FleetConfig(edge={"id": "yard"}, robots=(), **sections).model_copy(update={"robots": robots})
    pairs = tuple((robot, Plugin("walker", "a package")) for robot in robots)
    return Loaded(config, Registry([]), pairs, folder, {robot.name: "{}" for robot in robots})


class Edge:
    """An edge with rex and max, without a bus; its loop is the test."""

    def __init__(self, folder, loop, **sections):
        self.folder, self.clock, self.later, self.stops, self.ticks = folder, ManualClock(), [], [], {}
        self.bus = Bus()
        self.history, self.heard = [], []
        scheduler = TickScheduler(loop, self.clock)
        self.configs = [config_of("rex"), config_of("max")]
        self.make = lambda config: local_robot(config, Walker, clock=self.clock, scheduler=scheduler)
        robots = {config.name: self.make(config) for config in self.configs}
        self.process = SimpleNamespace(
            bus=SimpleNamespace(control=self.bus, reports=self.bus),
            senders=None,
            history=SimpleNamespace(
                add=lambda *event: self.history.append(event),
                on_event=lambda *event: self.heard.append(event),
            ),
            clock=self.clock,
            robots=robots,
            outbox=SimpleNamespace(sender=lambda _twin: None),
            loop=SimpleNamespace(call_soon_threadsafe=self.later.append),
            scheduler=SimpleNamespace(every=lambda seconds, call: self.ticks.update({call: seconds})),
        )
        loaded = loaded_of(folder, *self.configs, **sections)
        self.missions = Missions(
            loaded, self.process, {}, folder, lambda names, why: self.stops.append((names, why))
        )

    def configure(self, **sections):
        for part in self.missions.configured:
            getattr(part, "configure", part)(loaded_of(self.folder, *self.configs, **sections))

    def refusal(self, robot, origin=ANNA, *, commands=True, navigates=False):
        return self.missions._refusal(robot, origin, commands, navigates)

    def turn(self):
        while self.later:
            self.later.pop(0)()


@pytest.fixture
async def build(tmp_path):
    made = []

    def build(**sections):
        made.append(Edge(tmp_path / "state", asyncio.get_running_loop(), **sections))
        return made[-1]

    yield build
    for each in made:
        each.missions.close()


async def test_it_answers_for_missions_and_runs_and_looks_after_them(build):
    edge = build()
    edge.missions.declare()
    assert edge.bus.answers == [keys.mission("yard", "*"), keys.run("yard", "*")]
    assert sorted(edge.ticks.values())[:2] == sorted((POLL_INTERVAL, EVERY))
    assert edge.missions.problem == ""


async def test_the_stop_of_a_run_reaches_its_own_robots_here_and_those_of_partners_there(build):
    edge = build(partners=PARTNERS)
    edge.missions.runs.stop(("rex", "tom"), "rex failed")
    assert edge.stops == [(("rex",), "rex failed")]
    wait_until("the partner is told", lambda: edge.bus.puts)
    assert edge.bus.puts == [(keys.stop("barn"), b'["tom"]', True)]


async def test_the_stop_of_partners_robots_alone_stops_none_here(build):
    """Without names it would be a stop of all."""
    edge = build(partners=PARTNERS)
    edge.missions.runs.stop(("tom",), "tom failed")
    wait_until("the partner is told", lambda: edge.bus.puts)
    assert edge.stops == []


async def test_a_stop_of_robots_is_told_to_the_runs_on_the_loop(build):
    edge, told = build(), []
    edge.missions.runs.stopped = lambda names, why: told.append((names, why))
    edge.process.on_stop(("rex", "max"), local_cause("", "smoke"))
    assert told == []
    edge.turn()
    assert told == [(("rex", "max"), "smoke")]


async def test_an_event_of_a_robot_goes_to_the_history_and_to_the_runs_if_there_are_any(build, monkeypatch):
    edge, told = build(), []
    edge.missions.declare()
    edge.missions.runs.handle_event = lambda *event: told.append(event)
    event = EventReport(1.0, EventKind.FAILSAFE, "low battery")
    edge.process.history.on_event("rex", event)
    edge.turn()
    monkeypatch.setattr(type(edge.missions.runs), "any", True)
    edge.process.history.on_event("rex", event)
    edge.turn()
    assert edge.heard == [("rex", event)] * 2, "whoever listened before still hears it"
    assert told == [("rex", "failsafe")]


async def test_a_program_on_the_bus_may_tell_an_event_of_a_robot(build, monkeypatch):
    edge, told = build(), []
    edge.missions.declare()
    monkeypatch.setattr(type(edge.missions.runs), "any", True)
    edge.missions.runs.handle_event = lambda *event: told.append(event)
    calls = edge.bus.subscriptions["cw/*/data/event"]
    twins = {str(config.twin): config.name for config in edge.configs}
    assert {key.split("/")[1] for key in calls} == set(twins)
    for key, call in calls.items():
        call(json.dumps({"event_type": f"person_seen_by_{twins[key.split('/')[1]]}"}).encode())
    edge.turn()
    assert sorted(told) == [("max", "person_seen_by_max"), ("rex", "person_seen_by_rex")]


async def test_only_who_may_command_a_robot_may_start_a_mission_with_it(build):
    edge = build(partners=PARTNERS)
    assert edge.refusal("rex") is None
    edit = Origin(Transport.BUS, "edit", "vic")
    assert edge.refusal("rex", edit, commands=False) is None
    assert "accepts" in edge.refusal("rex", edit)
    assert "accepts" in edge.refusal("rex", edit, commands=False, navigates=True)
    assert edge.refusal("tom", edit) is None, "its own edge judges"
    assert edge.refusal("nobody") == "nobody is no robot of this edge"


async def test_a_robot_that_comes_may_be_in_runs_and_one_that_goes_may_not(build):
    edge = build()
    edge.missions.declare()
    added = edge.make(config_of("arm"))
    edge.missions.join(added)
    twins = {key.split("/")[1] for key in edge.bus.subscriptions["cw/*/data/event"]}
    assert (edge.refusal("arm"), "arm" in edge.missions.runs.robots, added.twin in twins) == (
        None,
        True,
        True,
    )
    edge.missions.leave("arm")
    twins = {key.split("/")[1] for key in edge.bus.subscriptions["cw/*/data/event"]}
    assert (edge.refusal("arm"), added.twin in twins) == ("arm is no robot of this edge", False)
    assert sorted(edge.missions.runs.robots) == ["max", "rex"]
    edge.missions.leave("arm")  # a second time changes nothing


async def test_candidates_are_the_robots_here_with_their_groups_and_those_of_partners(build):
    edge = build(partners=PARTNERS, groups={"crew": ["rex"]})
    found = {one.name: one for one in edge.missions._candidates()}
    assert sorted(found) == ["max", "rex", "tom"]
    assert {name: set(one.groups) for name, one in found.items()} == {
        "rex": {"crew"},
        "max": set(),
        "tom": set(),
    }
    assert "goto" in found["rex"].can
    assert (found["tom"].can, "barn does not answer" in found["tom"].trouble) == (frozenset(), True)
    edge.configure(groups={"crew": ["max"]})
    assert {one.name for one in edge.missions._candidates() if one.groups} == {"max"}


async def test_changed_places_are_those_of_the_next_run_and_wait_for_the_end_of_this_one(build):
    edge = build(places={"gate": {"at": [1.0, 2.0]}})
    site = edge.missions.runs.site
    edge.configure(places={"gate": {"at": [1.0, 2.0]}})
    assert edge.missions.runs.site is site, "nothing changed"
    edge.configure(places={"gate": {"at": [5.0, 2.0]}, "dock": {"at": [0.0, 0.0], "capacity": 1}})
    assert edge.missions.runs.site.places["gate"].at == (5.0, 2.0)
    assert not edge.missions.runs.places.is_full("dock"), "it can be occupied"
    assert [edge.missions.blocker(section) for section in ("places", "missions")] == ["", ""]
    edge.missions.runs.all = lambda: [SimpleNamespace(id="r1"), SimpleNamespace(id="r2")]
    assert edge.missions.blocker("places") == "run r1, r2 uses the places: wait for its end"
    assert edge.missions.blocker("missions") == ""
