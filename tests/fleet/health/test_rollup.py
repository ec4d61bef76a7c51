from hypothesis import given
from hypothesis import strategies as st

from fleet.health.rollup import SILENT_AFTER, Reach, SeenEdge, roll_up
from fleet.model.summary import Summary, Trouble

NOW = 10_000.0
HUB = Trouble("offline", "No such device; is it plugged in?", 9000.0, 3, "ugv", "serial:/dev/ttyUSB3", ("a",))


def summary(edge, *troubles, stamp=NOW, robots=None, **fields):
    fields.setdefault("version", "1.0")
    return Summary(edge, stamp=stamp, uptime=1.0, robots=robots or {"ok": 20}, troubles=troubles, **fields)


def up(edge, *troubles, heard=NOW, **fields):
    return SeenEdge(edge, True, 1.0, summary(edge, *troubles, **fields), heard)


def test_what_is_wrong_names_who_the_link_the_edge_and_the_next_thing_to_do():
    view = roll_up([up("edge-a"), up("edge-b", HUB, robots={"ok": 17, "offline": 3})], NOW)
    (row,) = view.rows
    assert (row.what, row.link, row.edges) == ("3 ugv robots offline", "serial:/dev/ttyUSB3", ("edge-b",))
    assert row.next == "check the cable, the hub and its power: serial:/dev/ttyUSB3"
    assert view.edges == {"up": 2}
    assert view.robots == {"ok": 37, "offline": 3}
    assert view.versions == {"1.0": 2}


def test_one_cause_on_many_edges_is_one_row_since_the_first_of_them():
    cloud = Trouble("degraded", "the broker refuses us", 8000.0)
    later = Trouble("degraded", "the broker refuses us", 9000.0)
    (row,) = roll_up([up("b", later), up("a", cloud), up("c")], NOW).rows
    assert (row.what, row.edges, row.since) == ("2 edges degraded", ("a", "b"), 8000.0)


def test_the_oldest_cause_comes_first():
    young = Trouble("fault", "hot", 9999.0, 1, "ugv", "", ("x",))
    rows = roll_up([up("a", young), up("b", HUB)], NOW).rows
    assert [row.since for row in rows] == [9000.0, 9999.0]


def test_an_edge_that_is_gone_stays_with_the_time_and_its_robots_are_unknown():
    gone = SeenEdge("b", False, 9500.0, summary("b", HUB, stamp=9400.0), 9400.0)
    view = roll_up([up("a"), gone], NOW)
    (row,) = view.rows
    assert (row.what, row.since, row.cause) == (
        "1 edge gone",
        9500.0,
        "not on the bus; its robots send nothing",
    )
    assert view.robots == {"unknown": 20, "ok": 20}
    assert view.edges == {"up": 1, "gone": 1}


def test_an_edge_on_the_bus_that_sends_no_summary_is_silent():
    def reach(heard, changed, now=NOW):
        return SeenEdge("a", True, changed, summary("a"), heard).reach(now)

    assert reach(NOW - SILENT_AFTER, 1.0) is Reach.UP
    assert reach(NOW - SILENT_AFTER - 1, 1.0) is Reach.SILENT
    assert reach(0.0, NOW - 1) is Reach.UP, "it has just come"
    (row,) = roll_up([SeenEdge("a", True, 100.0)], NOW).rows
    assert (row.what, row.since) == ("1 edge silent", 100.0)


def test_times_are_by_the_clock_of_who_looks():
    slow = up("a", Trouble("fault", "hot", 100.0, 1), stamp=160.0, heard=NOW)
    assert [row.since for row in roll_up([slow], NOW).rows] == [NOW - 60.0]


def test_what_found_no_room_and_stopped_robots_are_counted():
    view = roll_up([up("a", HUB, more=4, stopped=2), up("b", more=1, stopped=1)], NOW)
    assert (view.more, view.stopped) == (5, 3)


troubles = st.builds(
    Trouble,
    level=st.sampled_from(["degraded", "offline", "fault"]),
    cause=st.text(max_size=160),
    since=st.floats(0, 2e9),
    robots=st.integers(0, 20),
    link=st.text(max_size=80),
    names=st.lists(st.text(max_size=63), max_size=3).map(tuple),
)


@given(
    st.lists(st.tuples(st.booleans(), st.floats(0, NOW), st.lists(troubles, max_size=5)), max_size=20),
    st.floats(0, 2e9),
)
def test_every_trouble_of_an_edge_that_is_up_and_every_edge_that_is_not_has_a_row(edges, now):
    seen = [
        SeenEdge(f"e{number}", alive, heard, summary(f"e{number}", *troubled), heard)
        for number, (alive, heard, troubled) in enumerate(edges)
    ]
    view = roll_up(seen, now)
    assert sum(view.edges.values()) == len(seen)
    assert sum(view.robots.values()) == 20 * len(seen)
    shown = {edge for row in view.rows for edge in row.edges}
    assert shown >= {each.edge for each in seen if each.reach(now) is not Reach.UP}
    troubled = sum(
        each.robots for edge in seen if edge.reach(now) is Reach.UP for each in edge.summary.troubles
    )
    assert sum(row.robots for row in view.rows) == troubled
    assert all(row.next and 0 <= row.since <= max(now, NOW) for row in view.rows)
    assert [row.since for row in view.rows] == sorted(row.since for row in view.rows)
