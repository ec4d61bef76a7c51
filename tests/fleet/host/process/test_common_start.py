"""Several robots that begin at one instant, or none: on a real bus, in two processes."""

import asyncio
import json
import subprocess
import sys
import time
from contextlib import asynccontextmanager

import msgspec
import pytest

from fleet.bus import keys
from fleet.model.command import Reply, ReplyStatus
from fleet.model.common_start import StartAnswer, StartSignal

HERE = {"worker": "main", "stands": True}
THERE = {"worker": "arm", "stands": True}
GOTO = {"command": "goto", "position": [1.0, 2.0, 0.0]}
ID = "start-1"
LOADED = 2.0  # s by which a busy computer may be late; ``python -m bench together`` measures what it is


class StartRequester:
    """Who starts the robots of a yard, on a session of its own."""

    def __init__(self, place, bus_session):
        self.place, self.bus_session = place, bus_session
        self.answers = {}
        self.vanish = bus_session.token(keys.starting(place.id, ID))

    def prepare(self, robot, message=GOTO, kind="navigate", start=ID, **parameters):
        """Ask a robot to prepare; returns its first answer."""
        payload = json.dumps({**message, "action_id": robot, "timestamp": time.time()}).encode()
        given = {"kind": kind, "start": start, **parameters}
        replies = self.bus_session.request(
            keys.prepare(self.place.id, robot), payload, timeout=60, parameters=given
        )
        self.answers[robot] = (msgspec.json.decode(reply, type=Reply) for _, reply in replies)
        return next(self.answers[robot])

    def prepared(self, *robots):
        """Ask robots to prepare, and have it that they do."""
        for robot in robots:
            reply = self.prepare(robot)
            assert reply.ok, reply

    def tell(self, ahead, start=ID):
        """Tell the instant; returns it, and why robots will not begin."""
        stamp = time.time() + ahead
        requested = msgspec.json.encode(StartSignal(start, stamp))
        found = {}
        for _, answer in self.bus_session.request(keys.starts(self.place.id), requested, timeout=60):
            found |= msgspec.json.decode(answer, type=StartAnswer).robots
        return stamp, found

    def ends(self, robot):
        """Return what a robot answers after it was prepared."""
        return list(self.answers[robot])


@pytest.fixture
def serve(yard, run_edge, requests):
    """Run an edge with robots; gives its place, the edge, and who asks."""

    @asynccontextmanager
    async def serve(*, groups=None, **robots):
        place = yard(**robots)
        place.change(groups=groups or {})
        edge = place.edge()
        async with run_edge(edge):
            await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
            await requests.until(lambda: all(state.position is not None for state in edge.states()))
            bus_session = await asyncio.to_thread(place.bus_session)
            asker = await asyncio.to_thread(StartRequester, place, bus_session)
            try:
                yield place, edge, asker
            finally:
                await asyncio.to_thread(bus_session.close)

    return serve


def begun(place):
    """Return who has begun, and when (monotonic s)."""
    return {
        robot: at
        for robot in ("rex", "max", "arm")
        for _, at, word in place.calls(robot)
        if word == "navigate"
    }


async def test_all_begin_at_the_instant_in_whatever_process_they_are_or_nobody_when_who_asks_vanishes(
    serve, requests
):
    async with serve(rex=HERE, max=HERE, arm=THERE) as (place, _, asker):
        await every_process_tells_its_time(asker)
        await nobody_begins_when_who_asks_vanishes(place, asker)
        another = await asyncio.to_thread(StartRequester, place, asker.bus_session)
        await asyncio.to_thread(another.prepared, "rex", "max", "arm")
        stamp, problems = await asyncio.to_thread(another.tell, 1.0)
        assert problems == {"rex": "", "max": "", "arm": ""}
        await requests.until(lambda: len(begun(place)) == 3)
        instant = time.monotonic() - (time.time() - stamp)
        assert all(-0.01 <= at - instant < LOADED for at in begun(place).values())
        assert [(await asyncio.to_thread(another.ends, name))[0].ok for name in ("rex", "max", "arm")] == [
            True
        ] * 3


async def every_process_tells_its_time(asker):
    """Ask all processes for their time."""
    requested = msgspec.json.encode(StartSignal())
    answers = await asyncio.to_thread(
        lambda: list(asker.bus_session.request(keys.starts(asker.place.id), requested, timeout=60))
    )
    found = {
        each.process: each.time for each in (msgspec.json.decode(a, type=StartAnswer) for _, a in answers)
    }
    assert found.keys() == {"main", "arm"}
    assert all(abs(stamp - time.time()) < 5.0 for stamp in found.values())


async def nobody_begins_when_who_asks_vanishes(place, asker):
    """Vanish after the instant was sent."""
    await asyncio.to_thread(asker.prepared, "rex", "arm")
    _, problems = await asyncio.to_thread(asker.tell, 1.0)
    assert problems == {"rex": "", "arm": ""}
    await asyncio.to_thread(asker.vanish)
    ends = [(await asyncio.to_thread(asker.ends, name))[0] for name in ("rex", "arm")]
    assert not any(end.ok for end in ends)
    await asyncio.sleep(1.2)
    assert begun(place) == {}


async def test_one_that_cannot_begin_keeps_the_others_from_it(serve):
    async with serve(rex=HERE, max=HERE) as (place, edge, asker):
        edge.process.stop_robots(("max",), _cause())
        await asyncio.to_thread(asker.prepared, "rex")
        reply = await asyncio.to_thread(asker.prepare, "max")
        assert (reply.status, "emergency stop" in reply.reason) == (ReplyStatus.REJECTED, True)
        await asyncio.to_thread(asker.vanish)
        (end,) = await asyncio.to_thread(asker.ends, "rex")
        assert (end.status, end.reason) == (
            ReplyStatus.REJECTED,
            "not started: its sender cancelled it, or is gone",
        )
        assert begun(place) == {}


def _cause():
    from fleet.host.requests.stop_cause import local_cause  # noqa: PLC0415

    return local_cause("", "test")


def _stop(place, bus_session, robot):
    list(
        bus_session.request(
            keys.command(place.id, robot), json.dumps({"command": "stop"}).encode(), timeout=60
        )
    )


def _emergency(place, bus_session, robot):
    list(bus_session.request(keys.stop(place.id), json.dumps([robot]).encode(), timeout=60))


def _emergency_and_release(place, bus_session, robot):
    _emergency(place, bus_session, robot)
    _release(place, bus_session, robot)


def _release(place, bus_session, robot):
    release = json.dumps({"command": "release_emergency_stop"}).encode()
    (*_, reply) = bus_session.request(keys.command(place.id, robot), release, timeout=60)
    assert msgspec.json.decode(reply[1], type=Reply).ok, reply


def _drive(place, bus_session, robot):
    move = {"command": "move_forward", "data": {"linear_x": 0.1}, "timestamp": time.time()}
    list(bus_session.request(keys.command(place.id, robot), json.dumps(move).encode(), timeout=60))


@pytest.mark.parametrize("interrupt", [_stop, _emergency, _emergency_and_release, _drive])
async def test_a_stop_or_somebody_else_who_moves_one_robot_ends_the_start_of_all(serve, interrupt):
    async with serve(rex=HERE, max=HERE) as (place, _, asker):
        await asyncio.to_thread(asker.prepared, "rex", "max")
        await asyncio.to_thread(asker.tell, 1.5)
        await asyncio.to_thread(interrupt, place, asker.bus_session, "max")
        ends = {name: (await asyncio.to_thread(asker.ends, name))[0] for name in ("rex", "max")}
        assert all(end.reason.startswith("not started: ") for end in ends.values()), ends
        assert "not without the others: max" in ends["rex"].reason
        await asyncio.sleep(1.7)
        assert begun(place) == {}


@pytest.mark.parametrize("message", [{"command": "stop"}, {"command": "stop", "action_id": 7, "x": [[]]}])
@pytest.mark.parametrize("kind", ["navigate", "command"])
async def test_a_stop_is_not_prepared_but_obeyed_at_once(serve, requests, message, kind):
    async with serve(rex=HERE) as (place, _, asker):
        await asyncio.to_thread(asker.prepare, "rex", message, kind)
        await requests.until(lambda: "stop" in place.words("rex"))


async def test_stops_pass_while_a_robot_is_prepared(serve, requests):
    async with serve(rex=HERE) as (place, _, asker):
        await asyncio.to_thread(asker.prepared, "rex")
        await asyncio.to_thread(_stop, place, asker.bus_session, "rex")
        await requests.until(lambda: "stop" in place.words("rex"))


async def test_an_instant_that_is_past_or_too_far_ahead_starts_nobody(serve):
    async with serve(rex=HERE) as (place, _, asker):
        for ahead, expected in ((-0.2, "s past"), (3600.0, "s ahead")):
            await asyncio.to_thread(asker.prepared, "rex")
            _, problems = await asyncio.to_thread(asker.tell, ahead)
            assert expected in problems["rex"]
            (end,) = await asyncio.to_thread(asker.ends, "rex")
            assert not end.ok
        assert begun(place) == {}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"start": "nobodys"}, "is not present"),
        ({"kind": "motion", "message": {"command": "move_forward"}}, "nothing that is started together"),
        ({"message": {"command": "goto", "position": [1, "x", 0]}}, "position"),
        ({"kind": "command", "message": {"command": "jump", "data": {}}}, "has no 'jump'"),
    ],
)
async def test_what_cannot_be_prepared_is_refused_with_the_reason(serve, given, expected):
    async with serve(rex=HERE) as (place, _, asker):
        reply = await asyncio.to_thread(lambda: asker.prepare("rex", **given))
        assert (reply.status, expected in reply.reason) == (ReplyStatus.REJECTED, True), reply
        assert place.words("rex") == ["run"] or "stop" not in place.words("rex")


async def test_a_message_that_is_old_is_not_prepared(serve):
    async with serve(rex=HERE) as (_, _, asker):
        payload = json.dumps({**GOTO, "action_id": "a", "timestamp": time.time() - 60.0}).encode()
        key, given = keys.prepare(asker.place.id, "rex"), {"kind": "navigate", "start": ID}
        (answer,) = await asyncio.to_thread(
            lambda: list(asker.bus_session.request(key, payload, timeout=60, parameters=given))
        )
        assert "60.0 s old" in msgspec.json.decode(answer[1], type=Reply).reason


async def test_a_robot_is_prepared_for_one_start_at_a_time(serve):
    async with serve(rex=HERE) as (_, _, asker):
        await asyncio.to_thread(asker.prepared, "rex")
        reply = await asyncio.to_thread(asker.prepare, "rex")
        assert reply.reason == "it is prepared for another start"


@pytest.mark.parametrize("other", [HERE, THERE])
async def test_robots_that_would_meet_are_not_started_together_in_whatever_process_they_are(
    serve, requests, other
):
    """Either of them alone could go there; each is prepared beside what the other is prepared for."""
    robots = {"rex": HERE | {"start": [0, 0, 0]}, "arm": other | {"start": [20, 0, 0]}}
    async with serve(**robots) as (place, edge, asker):
        await requests.until(lambda: not any(state.separation for state in edge.states()))
        here = {**GOTO, "position": [12.0, 0.0, 0.0]}
        there = {**GOTO, "position": [-12.0, 0.0, 0.0]}
        assert (await asyncio.to_thread(asker.prepare, "rex", here)).ok
        reply = await asyncio.to_thread(asker.prepare, "arm", there)
        if reply.ok:  # the other process has not heard of the first yet, but will by the instant
            await asyncio.sleep(0.5)
            _, problems = await asyncio.to_thread(asker.tell, 1.0)
            assert any("arm" in why or "rex" in why for why in problems.values()), problems
        else:
            assert "rex" in reply.reason, reply
        await asyncio.to_thread(asker.vanish)
        assert begun(place) == {}


async def test_an_aircraft_that_is_not_ready_is_refused_in_its_own_words(serve):
    async with serve(rex=HERE | {"fix": False}, max=HERE) as (place, _, asker):
        takeoff = {"command": "takeoff", "data": {}}
        reply = await asyncio.to_thread(asker.prepare, "rex", takeoff, "command")
        assert (reply.status, reply.reason) == (ReplyStatus.REJECTED, "not ready: gps: no fix")
        assert (await asyncio.to_thread(asker.prepare, "max", takeoff, "command")).ok
        assert "takeoff" not in place.words()


def run_fleet(*arguments):
    """Start ``fleet`` in a process of its own."""
    program = [sys.executable, "-m", "fleet", *arguments]
    return subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def walked(place):
    """Return when (monotonic s) each robot that walked began."""
    return [at for _, at, word in place.calls() if word == "walk"]


@pytest.fixture
def serve_group(serve):
    """Run an edge with a group of three robots in two processes."""
    robots = {"rex": HERE, "max": HERE, "arm": THERE}
    return lambda: serve(groups={"all": list(robots)}, **robots)


async def test_the_command_line_starts_a_group_at_one_instant_or_says_for_each_why_nobody_was_started(
    serve_group, requests, fleet
):
    async with serve_group() as (place, edge, asker):
        edge.process.stop_robots(("max",), _cause())
        code, out, err = await fleet("send", "all", "walk", "--at", "+6s")
        assert code == 5, (out, err)
        lines = dict(line.split(": ", 1) for line in out.splitlines())
        assert lines["max"].startswith("walk rejected: emergency stop is set (test); release it first")
        assert all("walk rejected: not started" in lines[name] for name in ("rex", "arm")), lines
        assert "no robot is started: max:" in err
        assert walked(place) == []
        await asyncio.to_thread(_release, place, asker.bus_session, "max")
        _, out, err = await fleet("send", "all", "walk", "--at", "+6s")
        assert sorted(out.splitlines()) == [f"{name}: walk done" for name in ("arm", "max", "rex")], err
        await requests.until(lambda: len(walked(place)) == 3)
        assert max(walked(place)) - min(walked(place)) < LOADED
        assert "3 of 3 ok" in err


async def test_a_command_line_that_is_killed_before_the_instant_starts_nobody(serve_group, requests):
    async with serve_group() as (place, edge, _):
        requested = run_fleet("send", "all", "walk", "--at", "+6s")
        prepared = _prepared_in(edge)
        await requests.until(lambda: any(one.stamp is not None for one in prepared.values()))
        requested.kill()
        await requests.until(lambda: not prepared)
        await asyncio.to_thread(requested.communicate)
        await asyncio.sleep(6.2)
        assert walked(place) == []


def _prepared_in(edge):
    """Return what is prepared in the process of an edge."""
    heard = edge.process.robots["rex"].controller.event_reporter.heard
    return heard.func.__self__._prepared
