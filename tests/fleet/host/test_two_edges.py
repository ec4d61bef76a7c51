"""Two edges on one bus, in one process: of one twin only one of them runs the robot."""

import asyncio
import contextlib
import json
import random

import pytest

from fleet.bus import keys
from fleet.clock import SystemClock
from fleet.config.load import load
from fleet.host.edge.edge import Edge
from fleet.host.process.twin_claims import SEEN_WITHIN, TwinClaim, holder, read_claim
from fleet.model.command import Transport

HERE = {"worker": "main"}


@pytest.fixture(params=["tcp", "unixsock-stream"])
def two(request, yard, free_port):
    """Return the yard of the first edge, and the maker of another that has one of its twins, and one more."""
    place = yard(rex=HERE, max=HERE)
    fleet = json.loads(place.file.read_text())
    endpoint = f"unixsock-stream/{place.runtime}/{place.id}.reports.sock"  # of every edge
    if request.param == "tcp":
        endpoint = f"tcp/127.0.0.1:{free_port}"
        fleet["bus"] = {"listen": [endpoint], "insecure": "local"}
        place.file.write_text(json.dumps(fleet))

    def second():
        own = {**fleet["robots"][1], "name": "own", "twin": "6f0c9a1e-0000-4000-8000-000000000009"}
        again = {**fleet["robots"][0], "name": "again"}
        other = {
            **fleet,
            "edge": {"id": f"{place.id}-b"},
            "bus": {"connect": [endpoint], "insecure": "local"},
            "robots": [again, own],
        }
        file = place.file.with_name("second.yaml")
        file.write_text(json.dumps(other))
        return Edge(load(file), directory=place.runtime, clock=SystemClock())

    return place, second


def state_of(edge, name):
    return next(state for state in edge.states() if state.name == name)


def all_states(edges):
    return [state for edge in edges for state in edge.states()]


async def test_the_later_edge_leaves_a_twin_to_the_first_and_takes_it_when_that_ends(two, run_edge, requests):
    place, make_second = two
    async with contextlib.AsyncExitStack() as second_stack:
        async with run_edge(place.edge()):
            await requests.until(lambda: place.words("rex") == place.words("max") == ["run"])
            second = make_second()
            await second_stack.enter_async_context(run_edge(second))
            await requests.until(lambda: place.words("own") == ["run"])
            await requests.until(lambda: place.id in state_of(second, "again").cause)
            again = state_of(second, "again")
            assert (again.health, place.words("again")) == ("offline", [])
            assert again.cause == f"edge {place.id} has its twin; one of the two must leave it out"
            refused = []
            request = b'{"command": "hang", "source_type": "tele"}'
            second.process.robots["again"].read("command", request, transport=Transport.BUS)(refused.append)
            assert not refused[0].ok
        await requests.until(lambda: state_of(second, "again").health == "ok")
        assert place.words("again") == ["run"]


@pytest.mark.parametrize("seed", range(4))
async def test_two_edges_that_start_at_any_offset_never_run_a_robot_together(two, run_edge, requests, seed):
    place, make_second = two
    offset = random.Random(seed).uniform(-1.5, 1.5)
    both = []

    def runs(edge):
        return bool({"rex", "again"} & edge.process.runs.tasks.keys())

    async def watch(edges):
        while True:
            if len(edges) == 2 and all(map(runs, edges)):
                both.append(asyncio.get_running_loop().time())
            await asyncio.sleep(0.002)

    edges = []
    async with contextlib.AsyncExitStack() as stack:
        watching = asyncio.create_task(watch(edges))
        makers = [place.edge, make_second] if offset > 0 else [make_second, place.edge]
        for number, make in enumerate(makers):
            edges.append(make())
            await stack.enter_async_context(run_edge(edges[-1]))
            await asyncio.sleep(abs(offset) if number == 0 else 0.0)
        await requests.until(lambda: any(map(runs, edges)))
        await requests.until(lambda: [one for one in all_states(edges) if "has its twin" in one.cause])
        await asyncio.sleep(SEEN_WITHIN)
        watching.cancel()
    assert both == []


async def test_a_robot_that_nobody_uses_is_let_go_when_the_cloud_shows_an_edge_that_was_first(
    two, run_edge, requests
):
    place, _ = two
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: place.words("rex") == ["run"])
        twin = edge.process.robots["rex"].twin
        edge.cloud_claims.handle_claim(twin, "yard-0")
        await requests.until(lambda: "yard-0" in state_of(edge, "rex").cause)
        assert place.words("max") == ["run"]
        edge.cloud_claims.handle_claim(twin, "")
        await requests.until(lambda: place.words("rex").count("run") == 2)


async def test_a_robot_that_somebody_moves_is_not_let_go_for_what_the_cloud_shows(two, run_edge, requests):
    place, _ = two
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: place.words("rex") == ["run"])
        rex = edge.process.robots["rex"]
        request = b'{"command": "move_forward", "source_type": "tele"}'
        rex.read("command", request, transport=Transport.BUS)(lambda _: None)
        edge.cloud_claims.handle_claim(rex.twin, "yard-0")
        await requests.until(lambda: "yard-0" in edge.state().cause)  # once nothing is worse
        assert "yard-0" not in state_of(edge, "rex").cause
        assert "halt" not in place.words("rex")


def test_whoever_claimed_first_has_it_and_both_come_to_that():
    ours, theirs = TwinClaim(5, "b"), TwinClaim(4, "a")
    assert (holder(ours, [theirs]), holder(theirs, [ours])) == ("a", "")
    assert (
        holder(TwinClaim(5, "b"), [TwinClaim(5, "a")]),
        holder(TwinClaim(5, "a"), [TwinClaim(5, "b")]),
    ) == ("a", "")


def test_whoever_has_not_claimed_yet_finds_any_claim_before_it():
    assert holder(None, [TwinClaim(9, "b"), TwinClaim(8, "c")]) == "c"
    assert holder(None, []) == ""


def test_who_has_a_twin_keeps_it_from_who_wanted_it_before():
    theirs, ours = TwinClaim(9, "b", held=True), TwinClaim(5, "a")
    assert (holder(ours, [theirs]), holder(theirs, [ours])) == ("b", "")
    assert holder(None, [TwinClaim(3, "c"), theirs]) == "b"


@pytest.mark.parametrize(
    "key", ["", "fleet/a", "fleet/a/claims/t", "fleet/a/claims/t/x", "fleet/a/claims/t/-1"]
)
def test_a_token_that_is_no_claim_is_none(key):
    assert read_claim(key) is None


def test_a_claim_is_read_from_its_token():
    assert read_claim(keys.claim("yard-1", "t", 5)) == ("t", TwinClaim(5, "yard-1"))
    assert read_claim(keys.claim("yard-1", "t", 5, held=True)) == ("t", TwinClaim(5, "yard-1", held=True))
