"""A robot runs only while no other edge is known to hold its twin, be it by the bus or by the cloud."""

import asyncio
import types

import pytest

from fleet.host.process import twin_holders
from fleet.host.process.twin_holders import TwinHolders

TWIN = "6f0c9a1e"


class Claims:
    """Claims on the bus that only note what they were given."""

    def __init__(self, edge, twins, bus_session, *, settle, changed, moves, clock):
        self.edge, self.twins, self.settle = edge, list(twins), settle
        self.changed, self.moves = changed, moves
        self.given_up = []
        self.give_up = self.given_up.append


class Runs:
    """Runs that only note what is asked of them."""

    def __init__(self):
        self.said = []

    def run(self, robot):
        self.said.append((robot.name, ""))

    def suspend(self, robot, why):
        self.said.append((robot.name, why))


def robot(name, twin):
    return types.SimpleNamespace(
        name=name, twin=twin, in_use=False, controller=types.SimpleNamespace(in_motion=False)
    )


class Bench:
    """The holders of the twins of a process with two robots."""

    def __init__(self):
        self.robots = {"rex": robot("rex", TWIN), "ada": robot("ada", "77b0")}
        self.runs = Runs()
        self.holders = TwinHolders("yard", None, self.robots, self.runs, settle=2.5, clock=None)
        self.changed = []
        self.holders.changed = lambda *given: self.changed.append(given)

    @property
    def said(self):
        said, self.runs.said = self.runs.said, []
        return said

    async def reads(self, payload):
        """Read a message on the bus's thread."""
        await asyncio.to_thread(self.holders.read, payload)
        await asyncio.sleep(0)
        return self.said


BARN = "edge barn has its twin; one of the two must leave it out"


@pytest.fixture
async def bench(monkeypatch):
    monkeypatch.setattr(twin_holders, "TwinClaims", Claims)
    return Bench()


async def test_the_twins_of_all_robots_are_claimed_and_none_runs_before_it_is_known_who_has_them(bench):
    claims = bench.holders.claims
    assert (claims.edge, claims.twins, claims.settle) == ("yard", [TWIN, "77b0"], 2.5)
    assert bench.said == []
    claims.changed(TWIN, "")
    assert bench.said == [("rex", "")]


async def test_a_robot_whose_twin_another_edge_has_is_suspended_and_told_why(bench):
    bench.holders.set_bus_holder(TWIN, "barn")
    assert (bench.said, bench.changed) == ([("rex", BARN)], [(TWIN, "barn")])
    bench.holders.set_bus_holder(TWIN, "")
    assert (bench.said, bench.changed[1:]) == ([("rex", "")], [(TWIN, "")])


@pytest.mark.parametrize("first", ["bus", "cloud"])
async def test_it_runs_again_only_when_neither_bus_nor_cloud_shows_another_holder(bench, first):
    hold = {"bus": bench.holders.set_bus_holder, "cloud": bench.holders.set_cloud_holder}
    second = "cloud" if first == "bus" else "bus"
    hold[first](TWIN, "barn")
    hold[second](TWIN, "barn")
    assert bench.said == [("rex", BARN)] * 2
    hold[first](TWIN, "")
    assert bench.said == [("rex", BARN)]
    hold[second](TWIN, "")
    assert bench.said == [("rex", "")]


async def test_a_twin_that_no_robot_of_this_process_has_is_only_passed_on(bench):
    bench.holders.set_bus_holder("unknown", "barn")
    assert (bench.said, bench.changed) == ([], [("unknown", "barn")])


async def test_the_holders_seen_in_the_cloud_come_by_the_bus(bench):
    assert await bench.reads(b'{"6f0c9a1e": "barn"}') == [("rex", BARN)]
    assert await bench.reads(b'{"6f0c9a1e": "barn"}') == [], "no change"
    assert await bench.reads(b"{}") == [("rex", "")], "a twin that is left out is held by none"


async def test_a_claim_that_only_the_cloud_shows_takes_no_robot_that_is_in_use(bench):
    bench.robots["rex"].in_use = True
    assert await bench.reads(b'{"6f0c9a1e": "barn"}') == []
    bench.robots["rex"].in_use = False
    assert await bench.reads(b'{"6f0c9a1e": "barn"}') == [("rex", BARN)]
    bench.robots["rex"].in_use = True
    assert await bench.reads(b"{}") == [("rex", "")], "to be given back needs no proof"


@pytest.mark.parametrize("payload", [b"", b"no json", b"[]", b'{"6f0c9a1e": 7}'])
async def test_a_message_that_cannot_be_read_changes_nothing(bench, payload, caplog):
    bench.holders.set_cloud_holder(TWIN, "barn")
    bench.runs.said.clear()
    assert await bench.reads(payload) == []
    assert "the holders of our twins cannot be read" in caplog.text


async def test_a_robot_that_may_run_again_runs_by_what_is_known(bench):
    bench.holders.update(bench.robots["rex"])
    assert bench.said == [], "nothing is known yet"
    bench.holders.set_bus_holder(TWIN, "")
    bench.holders.set_cloud_holder(TWIN, "barn")
    bench.runs.said.clear()
    bench.holders.update(bench.robots["rex"])
    assert bench.said == [("rex", BARN)]


async def test_what_is_known_of_a_twin_ends_with_the_last_robot_that_had_it(bench):
    bench.holders.set_cloud_holder(TWIN, "barn")
    bench.runs.said.clear()
    bench.holders.give_up(TWIN)
    assert bench.holders.claims.given_up == [TWIN]
    bench.holders.update(bench.robots["rex"])
    assert bench.said == []


async def test_a_robot_that_moves_here_or_in_a_worker_keeps_its_twin_meanwhile(bench):
    moves = bench.holders.claims.moves
    assert not moves(TWIN)
    bench.robots["ada"].controller.in_motion = True
    assert not moves(TWIN)
    bench.robots["rex"].controller.in_motion = True
    assert moves(TWIN)
    bench.robots["rex"].controller.in_motion = False
    bench.holders.moves_elsewhere = lambda twin: twin == TWIN
    assert moves(TWIN)
