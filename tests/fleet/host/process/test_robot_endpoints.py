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
from tests.tools.waiting import DEADLINE

THOUSAND = 1000
HERE = {"worker": "main"}
KEYS = (keys.command, keys.state, keys.description, keys.prepare)


class CountingSession:
    """A bus session that counts what is declared, and what is taken back."""

    def __init__(self):
        self.queryables, self.tokens, self.history = [], [], []

    def declare_queryable(self, key, _call, *, more=""):
        return self._kept(self.queryables, key, more)

    def token(self, key):
        return self._kept(self.tokens, key)

    def _kept(self, declared, *entry):
        declared.append(entry)
        self.history.append(("declared", entry[0]))

        def end():
            declared.remove(entry)
            self.history.append(("ended", entry[0]))

        return end


def robots(number):
    """Return robots that nothing is asked of."""
    return [SimpleNamespace(name=f"r-{each}", state=None, describe=None) for each in range(number)]


@pytest.fixture
async def make():
    """Return a maker of a process's endpoints, with the session that counts."""

    def make(*, alone):
        session = CountingSession()
        return session, RobotEndpoints("yard", SimpleNamespace(control=session), None, alone=alone)

    return make


async def test_a_thousand_robots_need_no_more_queryables_than_one(make):
    session, endpoints = make(alone=True)
    before = len(session.queryables)
    for robot in robots(THOUSAND):
        endpoints.join(robot)
    assert (before, len(session.queryables), len(session.tokens)) == (3, 3, THOUSAND)
    for robot in robots(THOUSAND):
        endpoints.leave(robot)
    assert (len(session.queryables), session.tokens) == (3, [])


async def test_one_process_of_several_declares_the_keys_of_its_own_robots_only(make):
    session, endpoints = make(alone=False)
    (robot,) = robots(1)
    endpoints.leave(robot)  # that was never served
    assert not session.queryables
    endpoints.join(robot)
    assert len(session.queryables) == 3
    assert not [key for key, _ in session.queryables if "*" in key]
    endpoints.leave(robot)
    assert not session.queryables


async def test_the_token_that_shows_a_robot_comes_last_and_goes_first(make):
    session, endpoints = make(alone=False)
    (robot,) = robots(1)
    endpoints.join(robot)
    endpoints.leave(robot)
    token = keys.robot("yard", "r-0")
    assert session.history[3:5] == [("declared", token), ("ended", token)]
    assert len(session.history) == 8


@pytest.mark.parametrize("alone", [True, False])
async def test_an_edge_takes_the_queries_to_all_robots_only_while_it_has_all(
    yard, run_edge, requests, monkeypatch, alone
):
    declared, answer = [], ZenohSession.declare_queryable

    def counted(session, key, call, **more):
        declared.append(key)
        return answer(session, key, call, **more)

    monkeypatch.setattr(ZenohSession, "declare_queryable", counted)
    place = yard(rex=HERE, max=HERE if alone else {"worker": "arms"})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        of_all = {make(place.id, "*") for make in KEYS}
        of_rex = {make(place.id, "rex") for make in KEYS}
        assert set(declared) & (of_all | of_rex) == (of_all if alone else of_rex)


@pytest.mark.parametrize("arm", [HERE, {"worker": "arms"}])
async def test_every_robot_of_an_edge_answers_and_an_unknown_one_is_silent(yard, run_edge, requests, arm):
    place = yard(rex=HERE, max=HERE, arm=arm)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        with contextlib.closing(place.bus_session()) as asker:

            async def answered(key, payload=b""):
                return await asyncio.to_thread(lambda: list(asker.request(key, payload, timeout=DEADLINE)))

            for name in ("rex", "max", "arm"):
                key = keys.command(place.id, name)
                ((answered_key, reply),) = await answered(key, b'{"command": "check_ready"}')
                assert (answered_key, msgspec.json.decode(reply, type=Reply).ok) == (key, True)
                for key in (keys.state(place.id, name), keys.description(place.id, name)):
                    assert {answered_key for answered_key, _ in await answered(key)} == {key}
            assert await answered(keys.command(place.id, "nobody"), b'{"command": "check_ready"}') == []
            described = await answered(keys.description("*", "*"))
            assert sorted(answered_key.split("/")[3] for answered_key, _ in described) == [
                "arm",
                "max",
                "rex",
            ]
