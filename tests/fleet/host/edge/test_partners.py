"""Robots of another edge in a run: led by one edge, made safe by their own when that falls silent."""

import asyncio
import contextlib
import json
import threading

import pytest

from fleet.client import Fleet
from fleet.clock import SystemClock
from fleet.config.load import load
from fleet.config.other_edges import PartnerConfig
from fleet.config.problems import InvalidConfig
from fleet.errors import Refused
from fleet.host.edge.edge import Edge
from fleet.host.edge.partners import Partners
from fleet.missions.state import Abort
from fleet.model.command import Transport
from fleet.testing.clock import ManualClock

HERE = {"worker": "main", "stands": True}
SITE = {"origin": [47.0, 8.0, 400.0]}
GO = {
    "version": 1,
    "roles": {"eye": {"from": "rex"}, "feet": {"from": "own"}},
    "quorum": {"feet": 0},
    "steps": [
        {"id": "out", "do": {"all": "walk"}},
        {"id": "rest", "wait": "10 min"},
    ],
}
AWAY = GO | {
    "steps": [
        {
            "id": "away",
            "do": {"feet": {"goto": [1, 1]}},
            "robot_failed": {"do": "walk", "then": "continue"},
        },
        {"id": "rest", "wait": "10 min"},
    ]
}
ODD = AWAY | {"steps": [AWAY["steps"][0] | {"robot_failed": {"do": "dance"}}, AWAY["steps"][1]]}


class Site:
    """Two edges of a site: ``yard`` runs missions with ``own``, a robot of ``barn``."""

    def __init__(self, place):
        self.place = place
        first = json.loads(place.file.read_text())
        self.barn_id = f"{place.id}-b"
        endpoint = f"unixsock-stream/{place.runtime}/{place.id}.reports.sock"
        twin = {"twin": "6f0c9a1e-0000-4000-8000-000000000009"}
        own = {**first["robots"][0], **twin, "name": "own", "start": [5, 5, 0]}
        own["clock_skew"] = 0.01  # one clock: a run may begin right after the stop of the one before
        self.second = {
            **first,
            "edge": {"id": self.barn_id},
            "site": SITE,
            "bus": {"connect": [endpoint], "insecure": "local"},
            "robots": [own],
            "partners": {place.id: {"coordinates": True}},
        }
        partners = {self.barn_id: {"robots": ["own"]}}
        place.change(missions={"go": GO, "away": AWAY, "odd": ODD}, partners=partners, site=SITE)
        self.yard = self.barn = None
        self.cut = False

    def build(self):
        """Build both edges; a partition between them is ``cut``."""
        self.yard = self.place.edge()
        file = self.place.file.with_name("second.yaml")
        file.write_text(json.dumps(self.second))
        self.barn = Edge(load(file), directory=self.place.runtime, clock=SystemClock())
        control = self.yard.bus.control
        request = control.request_later

        def request_later(key, payload, **how):
            if self.cut and key.startswith(f"fleet/{self.barn_id}/"):
                how["on_end"]()
            else:
                request(key, payload, **how)

        control.request_later = request_later
        for robot in self.yard.missions.partners.robots.values():
            arrived = robot.arrived
            robot.arrived = lambda payload, arrived=arrived: None if self.cut else arrived(payload)

    def own(self):
        """Return what the barn says of its robot."""
        return self.barn.process.robots["own"].state()

    def words(self):
        return self.place.words("own")


@pytest.fixture
def site(yard):
    return Site(yard(rex=HERE))


@pytest.fixture
async def both(site, run_edge, requests):
    """Run both edges, and start missions from the first."""

    @contextlib.asynccontextmanager
    async def both():
        site.build()
        async with run_edge(site.yard), run_edge(site.barn):
            own = site.yard.missions.partners.robots["own"]
            await requests.until(lambda: own.state().health == "ok" and own._state.placement)
            await requests.until(lambda: site.yard.states()[0].health == "ok")
            yield

    return both


def start(site, mission="go"):
    with Fleet(site.place.file) as fleet:
        return fleet.start(mission).id


async def test_a_mission_has_robots_of_two_edges(site, both, requests):
    async with both():
        run = await asyncio.to_thread(start, site)
        await requests.until(lambda: site.words().count("walk") == 1 and "walk" in site.place.words("rex"))
        await requests.until(lambda: site.own().run == run)
        state = site.yard.missions.runs.state(site.yard.missions.runs.find(run))
        assert {each.robot for each in state.robots} == {"rex", "own"}
        refused = []
        request = site.barn.process.robots["own"].read(
            "command", b'{"command": "walk"}', transport=Transport.BUS
        )
        request(refused.append)
        assert f"it is in run {run}" in refused[0].reason

        def abort():
            with Fleet(site.place.file) as fleet:
                fleet.run(run).abort()
                return fleet.run(run).wait().outcome

        assert await asyncio.to_thread(abort) == "aborted"
        await requests.until(lambda: not site.own().run)
        await requests.until(lambda: not site.barn.missions.coordinators._leases._held)
        site.yard.missions.runs.stop(("own",), "the mission failed")
        await requests.until(lambda: site.own().emergency_stop)
        assert not site.yard.process.robots["rex"].state().emergency_stop


async def falls_silent(site, requests, mission, does):
    """Cut the edges off from each other in a run; what its robot is told then, and not told after."""
    runs, own = site.yard.missions.runs, site.yard.missions.partners.robots["own"]
    before = len(site.words())
    run = await asyncio.to_thread(start, site, mission)
    await requests.until(lambda: len(site.words()) > before)
    held = site.barn.missions.coordinators._leases._held
    do = {"go": "hold", "away": "walk", "odd": "dance"}[mission]
    await requests.until(lambda: [robots for _, robots in held.values() if robots == {"own": do}])
    before = len(site.words())
    site.cut = True
    await requests.until(lambda: does in site.words()[before:] and not site.own().run)
    found = runs.find(run)
    await requests.until(lambda: found.engine.robots.members["own"].outcome)
    assert found.engine.robots.members["own"].outcome == "lost"
    assert found.engine.head.outcome is None, "the quorum holds: it goes on"
    site.cut = False
    await requests.until(lambda: own.state().reachable)
    after = len(site.words())
    late = json.dumps({"command": "walk", "session_id": f"run {run}"}).encode()
    answers = []
    own.read("command", late, transport=Transport.BUS)(answers.append)
    await requests.until(lambda: answers)
    assert "it has left the run" in answers[0].reason
    found.handle(Abort("anna"))
    rex = site.yard.process.robots["rex"]
    await requests.until(lambda: runs.find(run) is None and not own.state().run and not rex.state().run)
    assert "walk" not in site.words()[after:], "a robot that was lost is not commanded again"


async def test_bus_partition_two_edges(site, both, requests):
    async with both():
        await falls_silent(site, requests, "go", "stop")
        await falls_silent(site, requests, "odd", "stop")  # it has no such command
        await falls_silent(site, requests, "away", "walk")


async def test_an_edge_that_fleet_yaml_does_not_name_gets_no_robot(site, both):
    site.second["partners"] = {"elsewhere": {"coordinates": True}}
    async with both():
        with pytest.raises(Refused, match="coordinate its robots"):
            await asyncio.to_thread(start, site)
        assert "walk" not in site.words()


async def test_robots_of_partner_edges_are_kept_apart(site, both, requests):
    (rex,) = json.loads(site.place.file.read_text())["robots"]
    site.place.change(robots=[rex | {"start": [0, 0, 0]}])
    site.second["partners"][site.place.id]["robots"] = ["rex"]
    async with both():
        rex, own = site.yard.process.robots["rex"], site.barn.process.robots["own"]
        await requests.until(lambda: not rex.state().separation and not own.state().separation)
        for robot, x, other in ((rex, 5, "own"), (own, -5, "rex")):
            answers = []
            goal = {"command": "goto", "source_type": "tele", "position": [x, x, 0]}
            robot.read("navigate", json.dumps(goal).encode(), transport=Transport.BUS)(answers.append)
            await requests.until(lambda answers=answers: answers)
            assert f"0.0 m from {other}" in answers[0].reason


async def test_places_mean_nothing_to_a_robot_whose_site_has_another_origin(site, both, requests):
    site.second["site"] = {"origin": [48.0, 8.0, 400.0]}
    async with both():
        run = await asyncio.to_thread(start, site, "away")
        found = site.yard.missions.runs.find(run)
        await requests.until(lambda: found.engine.robots.members["own"].outcome)
        assert "not placed in the site's frame" in found.engine.robots.members["own"].reason
        assert "navigate" not in site.words()


def test_a_partners_robot_needs_a_name_of_its_own(site):
    site.place.change(partners={site.barn_id: {"robots": ["rex"]}, site.place.id: {}})
    with pytest.raises(InvalidConfig) as error:
        load(site.place.file)
    problems = sorted(str(problem) for problem in error.value.problems)
    assert any("there is another robot 'rex'" in each for each in problems)
    assert any("this is the edge of this file" in each for each in problems)


class Congested:
    """A bus session whose messages do not go out, or fail."""

    def __init__(self, fails):
        self.fails, self.go = fails, threading.Event()

    def put(self, *_arguments, **_how):
        if self.fails:
            raise OSError("the session is closed")
        assert self.go.wait(20)


@pytest.mark.parametrize("fails", [True, False])
def test_a_partners_stop_that_does_not_go_out_does_not_delay_the_stop_of_our_own_robot(fails):
    control, partners = Congested(fails), {"barn": PartnerConfig(robots=("own",))}
    found = Partners("yard", partners, control, site=None, soon=lambda call: call(), clock=ManualClock())
    assert found.stop(("own", "rex")) == ("rex",)
    control.go.set()
