import pytest

from fleet.bridge.twin_conflicts import GONE_AFTER, WITHIN, TwinConflictMonitor
from fleet.wire.edge_heartbeat import EdgeHeartbeat

TWIN = "t"


@pytest.fixture
def claims():
    return []


@pytest.fixture
def rivals(clock, claims):
    made = TwinConflictMonitor(
        edge="yard-2",
        session="us",
        ignored=frozenset({"core"}),
        changed=lambda *claim: claims.append(claim),
        clock=clock,
    )
    clock.advance(100.0)
    return made


def beat(uptime=500.0, edge="yard-1", session="them"):
    return EdgeHeartbeat(edge, session, uptime)


def test_an_edge_that_was_there_before_has_the_twin_once_it_was_heard_twice(rivals, claims, clock):
    rivals.handle_heartbeat(TWIN, beat())
    assert claims == []
    for _ in range(3):
        clock.advance(5.0)
        rivals.handle_heartbeat(TWIN, beat())
    assert claims == [(TWIN, "yard-1")]


def test_a_single_stray_heartbeat_takes_nothing(rivals, claims, clock):
    for _ in range(4):
        rivals.handle_heartbeat(TWIN, beat())
        clock.advance(WITHIN + 1)
    assert claims == []


@pytest.mark.parametrize(
    "other", [beat(50.0), beat(edge="core"), beat(session="us")], ids=["later", "ignored", "ourselves"]
)
def test_nobody_else_takes_it(rivals, claims, other):
    for _ in range(5):
        rivals.handle_heartbeat(TWIN, other)
    assert claims == []


def test_an_edge_of_our_own_name_with_another_session_is_another_edge(rivals, claims):
    for _ in range(2):
        rivals.handle_heartbeat(TWIN, beat(edge="yard-2"))
    assert claims == [(TWIN, "yard-2")]


def test_an_edge_that_lives_keeps_the_twin_though_no_more_are_remembered(rivals, claims, clock, monkeypatch):
    monkeypatch.setattr("fleet.bridge.twin_conflicts.MOST", 3)
    for _ in range(6):
        rivals.handle_heartbeat(TWIN, beat())
        for number in range(4):
            rivals.handle_heartbeat(TWIN, beat(edge=f"made up {clock.time()} {number}"))
        rivals.check()
        clock.advance(5.0)
    assert claims == [(TWIN, "yard-1")]


def test_a_twin_is_taken_back_when_the_other_edge_has_gone_silent(rivals, claims, clock):
    for _ in range(2):
        rivals.handle_heartbeat(TWIN, beat())
    clock.advance(GONE_AFTER)
    rivals.check()
    assert claims == [(TWIN, "yard-1")]
    clock.advance(0.1)
    rivals.check()
    assert claims == [(TWIN, "yard-1"), (TWIN, "")]
