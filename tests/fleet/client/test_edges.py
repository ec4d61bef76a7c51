"""A command reaches the running edges, and finds the robot, group or place that it names."""

import re

import pytest

from fleet.bus.settings import BusSettings
from fleet.client import edges as module
from fleet.client.edges import START, Edges, UnknownRobot, site_of
from fleet.errors import BusError, NotRunning
from fleet.model.place import Place
from tests.fleet.client.answering import Session, edge, edges_of, names, refused, robot


class Here:
    """The edges that run on this computer; those in ``locked`` refuse to be joined."""

    def __init__(self, monkeypatch, tmp_path, *running, locked=()):
        self.sessions, self.locked = {}, locked
        monkeypatch.setattr(module, "client_dirs", lambda: [tmp_path])
        monkeypatch.setattr(module, "running_edges", lambda _path: list(running))
        monkeypatch.setattr(module, "join_control", self.join)

    def join(self, settings, _directory):
        if settings.edge in self.locked:
            raise BusError("it wants a password")
        return self.sessions.setdefault(settings.edge, Session())


def test_without_a_running_edge_it_says_how_to_start_one(monkeypatch, tmp_path):
    Here(monkeypatch, tmp_path)
    with pytest.raises(NotRunning, match=f"no edge is running here; {re.escape(START)}"):
        Edges.reach(None)


def test_all_edges_that_can_be_joined_are_reached_and_left(monkeypatch, tmp_path):
    here = Here(monkeypatch, tmp_path, "yard", "cell", "barn", locked=["cell"])
    with Edges.reach(None) as edges:
        assert (edges.joined, edges.unreached) == (("barn", "yard"), ["edge cell: it wants a password"])
        assert not edges.are_all(None)
        assert edges.are_all("fleet.yaml")
    assert all(session.closed for session in here.sessions.values())


@pytest.mark.parametrize("file", [None, "fleet.yaml"])
def test_an_edge_that_nobody_may_join_is_reported_with_what_helps(monkeypatch, tmp_path, file):
    Here(monkeypatch, tmp_path, "cell", locked=["cell"])
    monkeypatch.setattr(module, "settings_of", lambda _file: BusSettings("cell"))
    with pytest.raises(NotRunning) as caught:
        Edges.reach(file)
    advice = "" if file else "; if it has a password, give its file: -f fleet.yaml"
    assert str(caught.value) == f"edge cell: it wants a password{advice}"


def test_the_site_of_a_file_is_empty_where_it_says_none(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text("edge: {id: yard, site: north}\nrobots: []\n")
    assert (site_of(str(file)), site_of(None)) == ("north", None)
    file.write_text("edge: {id: yard}\nrobots: []\n")
    assert site_of(str(file)) == ""


def test_states_are_told_by_edge_and_name_and_of_two_the_newest():
    one, other = (
        Session().has(robot("rex"), robot("arm")),
        Session().has(robot("rex", stamp=2.0, mode="AUTO")),
    )
    edges = Edges({"yard": one, "barn": other.has(robot("max", "barn"))}, [])
    states = edges.states()
    assert names(states) == ["barn/max", "yard/arm", "yard/rex"]
    assert states[2].mode == "AUTO"
    assert edges.session_of(states[2]) is one, "the session that answered first"
    assert edges.session_of(robot("nobody")) is None


ROBOTS = (robot("rex"), robot("max"), robot("rex", "barn"), robot("solo", "barn"))
GROUPS = (edge(groups={"pack": ["max", "gone"], "none": []}), edge("barn", groups={"pack": ["solo"]}))


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("max", ["yard/max"]),
        ("yard/rex", ["yard/rex"]),
        ("barn/rex", ["barn/rex"]),
        ("pack", ["barn/solo", "yard/max", "yard/gone"]),
    ],
)
def test_a_robot_is_found_by_its_name_and_edge_and_a_group_by_its_own(name, found):
    assert names(edges_of(*ROBOTS, *GROUPS).named(name)) == found


def test_a_robot_of_a_group_that_does_not_run_is_named_with_the_cause():
    (gone,) = [state for state in edges_of(*ROBOTS, *GROUPS).named("pack") if state.name == "gone"]
    assert (gone.cause, gone.reachable) == ("it does not run on yard", False)


def test_two_robots_of_one_name_are_not_guessed():
    said = "there are several robots 'rex' (say which one: barn/rex, yard/rex)"
    assert refused(edges_of(*ROBOTS, *GROUPS).named, "rex") == said


PAIRS = [
    ("holder", "standby", ["yard/rex"]),
    ("fenced", "holder", ["barn/rex"]),
    ("", "standby", ["yard/rex"]),  # the other edge of the pair is not here
]


@pytest.mark.parametrize(("yard", "barn", "found"), PAIRS)
def test_of_a_pair_only_the_edge_with_the_lease_has_the_robot(yard, barn, found):
    assert names(edges_of(*ROBOTS, edge(pair=yard), edge("barn", pair=barn)).named("rex")) == found


def test_a_pair_without_a_holder_has_the_robot_twice():
    edges = edges_of(*ROBOTS, edge(pair="standby"), edge("barn", pair="fenced"))
    with pytest.raises(UnknownRobot, match="several"):
        edges.named("rex")


def test_an_empty_group_is_said_to_be_empty():
    said = "the group 'none' is empty: none of its robots runs"
    assert refused(edges_of(*ROBOTS, *GROUPS).named, "none") == said


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("mx", "did you mean 'max'?"),
        ("pac", "did you mean 'pack'?"),
        ("xyz", "there are: rex, solo, max, rex"),
    ],
)
def test_a_robot_that_is_not_there_is_answered_with_the_nearest_or_all(name, hint):
    assert refused(edges_of(*ROBOTS, *GROUPS).named, name) == f"there is no robot {name!r} ({hint})"


def test_why_a_robot_may_be_missing_is_in_the_hint():
    edges = edges_of(unreached=["edge cell: it wants a password"])
    assert refused(edges.named, "rex") == (
        "there is no robot 'rex' (there are: none; edge cell: it wants a password; "
        "edge yard runs but does not answer: its event loop hangs)"
    )


GATE, ELSEWHERE = Place("gate", (1.0, 2.0)), Place("gate", (9.0, 2.0))


PLACES = [
    ({"gate": GATE}, {"gate": ELSEWHERE}, "gate is not the same place on barn, yard"),
    ({"gate": GATE}, {}, "gate is not the same place on barn, yard"),
    ({"gates": GATE}, {}, "there is no place 'gate' (did you mean 'gates'?)"),
    ({"dock": GATE}, {"x": GATE}, "there is no place 'gate' (there are: dock, x)"),
    ({}, {}, "there is no place 'gate' (there are: none; places: in fleet.yaml)"),
]


@pytest.mark.parametrize(("yard", "barn", "said"), PLACES)
def test_a_place_that_is_not_one_and_the_same_for_all_robots_is_refused(yard, barn, said):
    edges = edges_of(edge(places=yard), edge("barn", places=barn), edge("cell", places={"gate": GATE}))
    assert refused(edges.place, "gate", ROBOTS[1:3]) == said


def test_a_place_is_that_of_the_edges_of_the_robots_alone():
    edges = edges_of(edge(places={"gate": GATE}), edge("barn", places={"gate": ELSEWHERE}))
    assert edges.place("gate", ROBOTS[:2]) == GATE
