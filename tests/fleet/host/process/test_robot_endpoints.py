"""What the robots of a process declare on the bus."""

import asyncio
import contextlib
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.host.process.robot_endpoints import RobotEndpoints
from fleet.model.command import Reply
from fleet.testing.waiting import DEADLINE

THOUSAND = 1000
HERE = {"worker": "main"}


class CountingSession:
    """A bus session that counts what is declared, and what is taken back."""

    def __init__(self):
        self.queryables, self.tokens = [], []

    def answer(self, key, _call, *, more=""):
        return self._kept(self.queryables, key, more)

    def token(self, key):
        return self._kept(self.tokens, key)

    def _kept(self, declared, *entry):
        declared.append(entry)
        return lambda: declared.remove(entry)


def robots(number):
    """Return robots that nothing is asked of."""
    return [SimpleNamespace(name=f"r-{each}", state=None, describe=None) for each in range(number)]


@pytest.fixture
async def make():
    """Return a maker of a process's endpoints, with the session that counts."""

    def make(worker=""):
        session = CountingSession()
        return session, RobotEndpoints("yard", SimpleNamespace(control=session), None, worker)

    return make


async def test_a_thousand_robots_need_no_more_queryables_than_one(make):
    session, endpoints = make()
    before = len(session.queryables)
    ends = [end for robot in robots(THOUSAND) for end in endpoints.open(robot)]
    assert (before, len(session.queryables), len(session.tokens)) == (3, 3, THOUSAND)
    for end in reversed(ends):
        end()
    assert not session.tokens


async def test_a_worker_declares_the_keys_of_its_own_robots_only(make):
    session, endpoints = make("arms")
    assert not session.queryables
    (robot,) = robots(1)
    ends = endpoints.open(robot)
    assert not [key for key, _ in session.queryables if "*" in key]
    assert len(session.queryables) == 3
    for end in reversed(ends):
        end()
    assert not session.queryables


async def test_the_token_that_shows_a_robot_comes_last_and_goes_first(make):
    session, endpoints = make("arms")
    (robot,) = robots(1)
    *ends, hide = endpoints.open(robot)
    hide()
    assert (len(session.tokens), len(session.queryables), len(ends)) == (0, 3, 3)


async def test_a_running_edge_has_no_queryable_for_a_single_robot(yard, run_edge, asks, monkeypatch):
    declared, answer = [], ZenohSession.answer

    def counted(session, key, call, **more):
        declared.append(key)
        return answer(session, key, call, **more)

    monkeypatch.setattr(ZenohSession, "answer", counted)
    place = yard(rex=HERE, max=HERE)
    edge = place.edge()
    async with run_edge(edge):
        await asks.until(lambda: all(state.health == "ok" for state in edge.states()))
        assert {keys.command(place.id, "*"), keys.prepare(place.id, "*")} <= set(declared)
        assert not [key for key in declared if "/rex/" in key or "/max/" in key]


async def test_every_robot_of_an_edge_answers_and_an_unknown_one_is_silent(yard, run_edge, asks):
    place = yard(rex=HERE, max=HERE, arm={"worker": "arms"})
    edge = place.edge()
    async with run_edge(edge):
        await asks.until(lambda: all(state.health == "ok" for state in edge.states()))
        with contextlib.closing(place.bus_session()) as asker:

            async def answered(key, payload=b""):
                return await asyncio.to_thread(lambda: list(asker.ask(key, payload, timeout=DEADLINE)))

            for name in ("rex", "max", "arm"):
                key = keys.command(place.id, name)
                ((told, reply),) = await answered(key, b'{"command": "check_ready"}')
                assert (told, msgspec.json.decode(reply, type=Reply).ok) == (key, True)
                for key in (keys.state(place.id, name), keys.description(place.id, name)):
                    assert {told for told, _ in await answered(key)} == {key}
            assert await answered(keys.command(place.id, "nobody"), b'{"command": "check_ready"}') == []
            described = await answered(keys.description("*", "*"))
            assert sorted(told.split("/")[3] for told, _ in described) == ["arm", "max", "rex"]
