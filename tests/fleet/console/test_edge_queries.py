"""What the console asks the edges for."""

from types import SimpleNamespace

import msgspec
import pytest

from fleet.console.edge_queries import EdgeQueries
from fleet.console.fleet_view import FleetView
from fleet.missions.report import MissionState
from fleet.model.state import RobotState


class Session:
    """A session that keeps its queries, for the test to answer."""

    identity = "c0"

    def __init__(self):
        self.queries = []

    def request_later(self, key, _payload, **query):
        self.queries.append((key, SimpleNamespace(**query)))


@pytest.fixture
def session():
    return Session()


@pytest.fixture
def arrived():
    return []


@pytest.fixture
def queries(session, arrived):
    view = FleetView()
    view.update_state(RobotState("rex", "", "toy", "yard-1", 1.0), 0.0)
    return EdgeQueries(
        view, lambda _edge: session, lambda: {"yard-1": session}, lambda *sample: arrived.append(sample)
    )


def test_only_a_known_robot_is_asked_for_its_vocabulary(queries, session):
    """The name comes from a page; it might match other keys of the bus."""
    for name in ("yard-1/*", "yard-1/**", "*/rex", "yard-1/max", "", "/"):
        queries.request_description(name)
    assert session.queries == []
    queries.request_description("yard-1/rex")
    assert [key for key, _ in session.queries] == ["fleet/yard-1/robots/rex/description"]


def test_the_missions_of_an_edge_are_handed_over_together(queries, session, arrived):
    queries.request_missions()
    ((_, query),) = session.queries
    answers = [MissionState("patrol", "yard-1"), MissionState("mow", "yard-1")]
    for each in answers:
        query.on_answer(msgspec.json.encode(each))
    assert arrived == []
    query.on_end()
    ((key, payload),) = arrived
    assert (key.split("/")[2], msgspec.json.decode(payload, type=list[MissionState])) == ("missions", answers)


def test_no_answer_is_not_taken_for_no_missions(queries, session, arrived):
    queries.request_missions()
    session.queries[0][1].on_end()
    assert arrived == []
