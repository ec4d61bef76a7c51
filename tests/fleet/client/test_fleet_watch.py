"""The view of a fleet: edges that come, go, fall silent, and are cut off from who looks."""

from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.client import fleet_watch
from fleet.client.fleet_watch import KEEP_EVERY, REFUSALS_SHOWN, SURE_AFTER, FleetWatch, of_sites
from fleet.client.seen_edges import FILE, SeenEdges
from fleet.errors import NotRunning
from fleet.health.rollup import SeenEdge
from fleet.model.summary import Summary
from fleet.testing.clock import ManualClock


class Session:
    """The session with one edge: what it shows at first, and what the test lets it say later."""

    def __init__(self, *alive, silent=()):
        self.alive, self.silent = list(alive), silent
        self.is_reached = True

    def subscribe(self, _key, call):
        self.heard = call

    def watch_tokens(self, _key, call):
        self.token = call

    def request(self, _key, _payload, *, timeout):
        return [(keys.summary(edge), summary(edge)) for edge in self.alive if edge not in self.silent]

    def tokens(self, _key, *, timeout):
        return [keys.edge(edge) for edge in self.alive]

    def reached(self):
        return self.is_reached

    def say(self, edge, payload=None, **fields):
        self.heard(keys.summary(edge), payload or summary(edge, **fields))

    def comes(self, edge):
        self.token(keys.edge(edge), True)

    def goes(self, edge):
        self.token(keys.edge(edge), False)


def summary(edge, **fields):
    return msgspec.json.encode(Summary(edge, "1.0", 1000.0, 1.0, **fields))


class Bus:
    """What ``Edges.reach`` finds: sessions, or nothing."""

    def __init__(self):
        self.sessions, self.joins, self.all_reached, self.unreached = (), 0, True, []

    def reach(self, _file):
        if not self.sessions:
            raise NotRunning("no edge is running here")
        self.joins += 1
        joined = tuple(session.alive[0] for session in self.sessions)
        state = {"sessions": self.sessions, "joined": joined, "unreached": self.unreached}
        return SimpleNamespace(**state, are_all=lambda _: self.all_reached, __exit__=lambda: None)


@pytest.fixture
def bus(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(tmp_path / "run"))
    bus = Bus()
    monkeypatch.setattr(fleet_watch, "Edges", bus)
    return bus


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def watch(bus, clock):
    """Return the maker of a view of some sessions."""

    def make(*sessions, file=None):
        bus.sessions = sessions
        return FleetWatch(file, clock)

    return make


def reaches(watch, clock):
    return {edge.edge: edge.reach(clock.time()).value for edge in watch.update()}


def test_edges_are_up_and_one_that_is_there_without_a_summary_is_silent(watch, clock):
    view = watch(Session("yard", "barn", silent=["barn"]))
    assert reaches(view, clock) == {"barn": "silent", "yard": "up"}
    assert (view.joined, view.problems) == (("yard",), [])


def test_an_edge_that_was_seen_before_and_is_not_there_is_gone_since_then(bus, watch, clock):
    SeenEdges(None).save([SeenEdge("attic", True, 5.0)])
    view = watch(Session("yard"))
    assert reaches(view, clock) == {"attic": "gone", "yard": "up"}
    assert view.update()[0].changed == 5.0


def test_an_edge_is_gone_only_when_its_token_has_been_away_for_a_while(watch, clock):
    session = Session("yard", "barn")
    view = watch(session)
    view.update()
    session.goes("barn")
    session.comes("barn")
    clock.advance(2 * SURE_AFTER)
    assert reaches(view, clock)["barn"] == "up", "its token was away for a moment"
    left = clock.time()
    session.goes("barn")
    clock.advance(SURE_AFTER - 0.01)
    assert reaches(view, clock)["barn"] == "up"
    clock.advance(0.02)
    assert reaches(view, clock)["barn"] == "gone"
    assert view.update()[0].changed == left
    session.comes("barn")
    assert reaches(view, clock)["barn"] == "up"


def test_an_edge_that_another_session_still_shows_is_not_gone(watch, clock):
    one, other = Session("yard", "barn"), Session("cell", "barn")
    view = watch(one, other)
    view.update()
    for session, reach in ((one, "up"), (other, "gone")):
        session.goes("barn")
        clock.advance(2 * SURE_AFTER)
        assert reaches(view, clock)["barn"] == reach


@pytest.mark.parametrize(("file", "here"), [(None, "gone"), ("fleet.yaml", "unseen")])
def test_who_is_cut_off_sees_no_edge_go_but_those_of_this_computer(bus, watch, clock, file, here):
    session = Session("yard", "barn")
    view = watch(session, file=file)
    view.update()
    clock.advance(5.0)
    view.update()
    seen, session.is_reached, bus.sessions = clock.time(), False, ()
    clock.advance(10.0)
    assert reaches(view, clock) == {"barn": "unseen", "yard": here}
    assert (view.update()[0].unseen, view.problems) == (seen, ["no edge is running here"])
    bus.sessions = (Session("yard"),)
    gone, up = view.update()
    assert (gone.alive, gone.changed, up.reach(clock.time())) == (False, seen, "up")


@pytest.mark.parametrize("cause", ["another edge runs here", "the link is lost"])
def test_it_joins_again_when_it_does_not_reach_all_edges_and_only_then(bus, watch, cause):
    session = Session("yard")
    view = watch(session)
    assert view.update() == view.update()
    assert bus.joins == 1
    session.is_reached, bus.all_reached = cause != "the link is lost", cause == "the link is lost"
    bus.unreached = ["edge cell: it wants a password"]
    view.update()
    assert (bus.joins, view.problems) == (2, ["edge cell: it wants a password"])


def test_garbage_is_reported_until_a_summary_is_good_and_the_last_good_one_counts(watch, clock, caplog):
    session = Session("yard")
    view = watch(session)
    view.update()
    session.say("yard", robots={"ok": 3})
    session.say("yard", b"garbage")
    session.say("yard", b"garbage")
    (edge,) = view.update()
    assert edge.summary.robots == {"ok": 3}
    assert view.problems[0].startswith("edge yard: a summary that cannot be read")
    assert len(caplog.records) == 1
    session.say("yard", robots={"ok": 4})
    assert (view.update()[0].summary.robots, view.problems) == ({"ok": 4}, [])
    for each in range(REFUSALS_SHOWN + 1):
        session.say(f"e{each}", b"garbage")
    view.update()
    assert len(view.problems) == REFUSALS_SHOWN


def test_more_edges_than_can_be_watched_are_reported_and_not_shown(watch, clock, monkeypatch):
    monkeypatch.setattr(fleet_watch, "MOST", 2)
    session = Session("yard", "barn", "cell")
    view = watch(session)
    assert list(reaches(view, clock)) == ["barn", "yard"]
    session.comes("attic")
    session.say("attic", b"garbage")
    assert len(view.update()) == 2
    assert view.problems == ["edge (others): more than 2 edges; the others are not shown"]


def test_what_was_seen_is_kept_now_and_then_and_at_the_end(watch, clock):
    session = Session("yard")
    with watch(session) as view:
        view.update()
        session.comes("barn")
        clock.advance(KEEP_EVERY - 0.1)
        view.update()
        assert list(SeenEdges(None).read()) == ["yard"]
        clock.advance(0.2)
        view.update()
        assert sorted(SeenEdges(None).read()) == ["barn", "yard"]
        clock.advance(5.0)
        view.update()
    assert SeenEdges(None).read()["yard"].changed == clock.time()


def test_an_edge_that_a_person_forgets_is_no_longer_shown_unless_it_is_alive(watch, clock):
    SeenEdges(None).save([SeenEdge("attic", False, 5.0)])
    view = watch(Session("yard"))
    view.update()
    for edge in ("attic", "yard"):
        SeenEdges(None).forget(edge)
    clock.advance(KEEP_EVERY)
    view.update()
    assert reaches(view, clock) == {"yard": "silent"}
    assert list(SeenEdges(None).read()) == ["yard"]


def test_a_list_that_cannot_be_read_is_a_problem_and_is_not_written_over(bus, watch, clock, tmp_path):
    file = tmp_path / "state" / "fleet" / FILE
    file.parent.mkdir(parents=True)
    file.write_text("{")
    view = watch(Session("yard"))
    assert reaches(view, clock) == {"yard": "up"}
    assert f"{FILE} cannot be read" in view.problems[0]
    assert file.read_text() == "{"


SITES = [
    (["near"], None, ["near", "new"]),
    (["near"], "south", ["far", "new"]),
    (["near"], "", ["new", "old"]),
    ([], None, ["new", "old"]),
]


@pytest.mark.parametrize(("joined", "site", "shown"), SITES)
def test_a_site_is_that_of_the_edges_here_or_the_given_one_and_edges_of_an_unknown_site(joined, site, shown):
    of = {"near": "north", "far": "south", "old": ""}
    edges = [SeenEdge(edge, True, 1.0, Summary(edge, "1", 1.0, 1.0, at)) for edge, at in of.items()]
    found = of_sites([*edges[:2], SeenEdge("new", True, 1.0), edges[2]], joined, site)
    assert [edge.edge for edge in found] == shown
