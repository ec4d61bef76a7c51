import msgspec
from hypothesis import given
from hypothesis import strategies as st

from fleet.cli.overview import overview, place_of
from fleet.model.geometry import Vector3
from fleet.model.state import EdgeState, RobotState

HEALTHS = ("ok", "degraded", "offline", "fault")


def robot(number, health="ok", cause="", **fields):
    settings = {"simulated": True, "mode": "AUTO.LOITER", "armed": True, "battery": 81.0, "reachable": True}
    settings |= {"site": Vector3(float(number), -2.0, 5.0), "speed": 1.0, "age": 0.3}
    return RobotState(
        f"drone-{number}", "", "mavlink", "yard-1", 1.0, health=health, cause=cause, **settings | fields
    )


def edge(name="yard-1", **fields):
    return EdgeState(name, "1", 1.0, 5.0, **fields)


FORTY = [
    robot(number, *(("offline", f"no heartbeat for {number} s") if number % 10 == 7 else ()))
    for number in range(1, 41)
]


def columns(line):
    return line.split()


def test_forty_robots_fit_a_small_screen_with_what_matters_of_each():
    lines = overview(FORTY, [edge()], width=80, height=24)
    assert len(lines) == 23
    assert max(map(len, lines)) <= 80
    assert lines[0] == "40 robots: 4 offline, 36 ok; all simulated"
    headings = ["ROBOT", "SIM", "HEALTH", "MODE", "BAT%", "SITE", "M/S", "AGE", "DOING"]
    assert columns(lines[1]) == headings
    assert lines[-1].startswith("not shown at this width: last command, kind")


def test_a_larger_screen_has_every_column():
    lines = overview(FORTY, [edge()], width=120, height=40)
    assert len(lines) == 39
    assert {"KIND", "LAST"} <= set(columns(lines[1]))


def test_the_worst_come_first_and_the_rest_is_counted():
    lines = overview(FORTY, [edge()], width=80, height=24)
    assert [columns(line)[0] for line in lines[2:6]] == ["drone-7", "drone-17", "drone-27", "drone-37"]
    shown = sum(line.startswith("drone-") and " sim " in line for line in lines)
    assert f"and {40 - shown} more ({40 - shown} ok): fleet ps --all" in lines


def test_everything_is_shown_where_there_is_no_bound():
    lines = overview(FORTY, [edge()])
    assert sum(line.startswith("drone-") and " sim " in line for line in lines) == 40


def test_causes_that_differ_in_measured_figures_alone_are_one_line():
    lines = [line for line in overview(FORTY, [edge()]) if "heartbeat" in line]
    assert lines == ["drone-7, drone-17, drone-27 and 1 more: no heartbeat for 7 s"]


def test_causes_that_differ_in_the_robots_own_name_alone_are_one_line_that_names_none():
    states = [robot(n, "fault", f"fleet send drone-{n} restart_adapter") for n in (1, 12)]
    assert "drone-1, drone-12: fleet send ROBOT restart_adapter" in overview(states, [edge()])


def test_other_figures_are_no_equal_causes():
    states = [robot(n, "offline", f"system {n} is not heard") for n in (1, 2)]
    assert "drone-2: system 2 is not heard" in overview(states, [edge()])


def test_a_robot_outside_the_sites_frame_says_whose_frame_it_is_in():
    assert place_of(robot(1, site=None, position=Vector3(1.0, 2.0, 3.0))) == "1.0 2.0 3.0 own"
    alone = [robot(1, site=None, position=Vector3(1.0, 2.0, 3.0))]
    assert "POSITION" in overview(alone, [edge()])[1]
    assert " own" not in "".join(overview(alone, [edge()]))


def test_real_and_simulated_robots_are_distinguished_and_counted():
    lines = overview([robot(1), robot(2, simulated=False)], [edge()], width=80, height=24)
    assert lines[0] == "2 robots: 2 ok; 1 simulated, 1 real"
    at = lines[1].index("SIM")
    assert [line[at : at + 4].strip() for line in lines[2:4]] == ["sim", "real"]


def test_an_emergency_stop_is_counted():
    stopped = robot(1, emergency_stop=True, activity="emergency stop")
    assert "1 with an emergency stop set" in overview([stopped, robot(2)], [edge()])[0]


def test_robots_of_several_edges_on_one_bus_are_distinguished():
    states = [robot(1), msgspec.structs.replace(robot(1), edge="barn")]
    lines = overview(states, [edge(), edge("barn")], width=120, height=40)
    assert {columns(line)[0] for line in lines[2:4]} == {"yard-1/drone-1", "barn/drone-1"}
    assert "EDGE" in lines[1]
    assert lines[0].startswith("2 robots on 2 edges")


def test_many_edges_are_counted_on_a_screen():
    edges = [edge(f"e-{n}", health="degraded" if n == 9 else "ok") for n in range(10)]
    lines = overview([], edges, width=80, height=24)
    assert any(line.startswith("edge e-9: degraded") for line in lines)
    assert "and 6 more edges (6 ok): fleet ps --all" in lines


texts = st.text(max_size=300)
states = st.builds(
    RobotState,
    name=st.text(min_size=1, max_size=70),
    twin=st.just(""),
    adapter=texts,
    edge=st.sampled_from(["yard-1", "barn"]),
    stamp=st.just(1.0),
    health=st.sampled_from(HEALTHS),
    cause=texts,
    mode=texts,
    battery=st.none() | st.floats(0, 100),
    site=st.none() | st.builds(Vector3, st.floats(-1e6, 1e6)),
    activity=texts,
    separation=texts,
    speed=st.none() | st.floats(0, 1e5),
    age=st.none() | st.floats(0, 1e9),
)


@given(
    st.lists(states, max_size=60),
    st.lists(st.builds(edge, st.text(max_size=40), cause=texts), max_size=12),
    st.integers(20, 200),
    st.integers(6, 60),
)
def test_whatever_robots_say_it_fits_the_screen_and_cannot_steer_it(found, edges, width, height):
    lines = overview(found, edges, width=width, height=height)
    assert len(lines) < height
    assert all(len(line) <= width and line.isprintable() for line in lines)
