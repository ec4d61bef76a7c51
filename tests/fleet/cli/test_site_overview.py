import pytest

from fleet.cli.site_overview import site_lines
from fleet.health.rollup import SeenEdge, roll_up
from fleet.model.summary import Summary, Trouble

NOW = 100_000.0
HUB = Trouble("offline", "gone; is it plugged in?", NOW - 720, 3, "ugv", "serial:/dev/ttyUSB3", ("a",))
CLOUD = Trouble("degraded", "the broker refuses us", NOW - 7200)


def up(name, *troubles, robots=None, site="", version="0.1.0"):
    summary = Summary(name, version, NOW, 3600.0, site, robots=robots or {"ok": 20}, troubles=troubles)
    return SeenEdge(name, True, 1.0, summary, NOW)


def gone(name, since):
    return SeenEdge(name, False, NOW - since, up(name).summary, NOW - since)


def shown(seen, width=100, height=30):
    return site_lines(roll_up(seen, NOW), seen, NOW, width=width, height=height)


def test_one_edge_with_forty_robots_is_a_few_lines():
    assert shown([up("yard-1", HUB, robots={"ok": 37, "offline": 3})]) == [
        "1 edge: 1 up; 40 robots: 3 offline, 37 ok",
        "12 min  3 ugv robots offline <- serial:/dev/ttyUSB3: gone; is it plugged in? <- yard-1",
        "        -> check the cable, the hub and its power: serial:/dev/ttyUSB3",
        "EDGE    ON THE BUS  HEALTH  ROBOTS            VERSION  UP",
        "yard-1  up          ok      3 offline, 37 ok  0.1.0    1 h",
    ]


def fleet_of_500():
    edges = [up(f"edge-{n:03}", site=f"site-{n % 9}") for n in range(440)]
    edges += [up(f"late-{n:03}", CLOUD, version="0.2.0") for n in range(40)]
    return [
        *edges,
        *(up(f"hub-{n}", HUB) for n in range(17)),
        *(gone(f"lost-{n}", 10.0 * n) for n in range(3)),
    ]


def test_500_edges_fit_a_screen_by_cause_the_oldest_first():
    lines = shown(fleet_of_500(), width=120, height=24)
    assert lines[0] == "500 edges: 3 gone, 497 up; 10000 robots: 60 unknown, 9940 ok"
    assert lines[1] == "fleet 0.1.0 (460), 0.2.0 (40)"
    assert lines[2].endswith(
        "40 edges degraded <- the broker refuses us <- late-000, late-001, late-002 and 37 more"
    )
    assert "51 ugv robots offline <- serial:/dev/ttyUSB3" in lines[4]
    assert "3 edges gone <- not on the bus; its robots send nothing <- lost-0, lost-1, lost-2" in lines[6]
    assert lines[9].startswith("lost-0 "), "the worst edges come first"
    assert lines[-1] == f"and {500 - (len(lines) - 10)} more edges: fleet top --all"
    assert len(lines) == 23


@pytest.mark.parametrize("height", [5, 8, 12, 24, 60])
@pytest.mark.parametrize("width", [40, 80, 200])
def test_nothing_leaves_the_screen_and_what_is_missing_is_counted(width, height):
    many = [
        up(f"e{n}", Trouble("fault", f"cause {chr(97 + n)}", NOW - n, 1, "ugv", "", ("r",)))
        for n in range(20)
    ]
    lines = shown(many, width, height)
    assert len(lines) < max(height, 6)
    assert all(len(line) <= width for line in lines)
    rest = "".join(lines)
    assert "more cause" in rest or height == 60
    assert "more edge" in rest or height == 60


def test_without_a_screen_everything_is_there():
    lines = shown(fleet_of_500(), None, None)
    assert len(lines) == 2 + 3 * 2 + 1 + 500


def test_what_an_edge_says_cannot_steer_the_terminal():
    evil = Trouble("fault", "\x1b[2J\r\n", NOW, 1, "ugv", "", ("r",))
    assert not {"\x1b", "\r", "\n"} & set("".join(shown([up("e", evil)])))


def test_causes_without_room_in_the_summaries_are_reported():
    edge = up("e", HUB)
    full = SeenEdge("e", True, 1.0, Summary("e", "1", NOW, 1.0, robots={"ok": 1}, more=3), NOW)
    assert "and 3 causes without room in the summaries: fleet ps" in shown([edge, full])
