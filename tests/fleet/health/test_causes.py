import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.health.causes import CauseParts, Onsets, folded, split_cause, troubles_of
from fleet.model.health import Health, Level
from fleet.model.state import RobotState
from fleet.model.summary import LISTED, Summary, decode, encode


def robot(name, health="offline", cause="silent", adapter="ugv"):
    return RobotState(name, "", adapter, "yard", 0.0, health=health, cause=cause)


def troubles(states, services=(), links=None, onsets=None, now=100.0):
    onsets = onsets or Onsets()
    onsets.note(states, services, now)
    return troubles_of(states, services, onsets, links or {})


@pytest.mark.parametrize(
    ("cause", "link", "why"),
    [
        ("serial:/dev/ttyUSB3: gone; is it plugged in?", "serial:/dev/ttyUSB3", "gone; is it plugged in?"),
        ("udpin:127.0.0.1:14550: Address in use", "udpin:127.0.0.1:14550", "Address in use"),
        ("bus 'left' (can:can0): it is closed", "can:can0", "it is closed"),
        ("worker arms: ended with exit code 1", "worker arms", "ended with exit code 1"),
        ("ValueError: no", "", "ValueError: no"),
        ("no heartbeat", "", "no heartbeat"),
        ("", "", ""),
    ],
)
def test_a_cause_is_taken_apart_into_the_way_and_the_rest(cause, link, why):
    assert split_cause(cause) == CauseParts(link, why)


def test_robots_that_hang_on_one_hub_are_one_trouble():
    states = [robot(f"rover-{n}", cause=f"serial:/dev/ttyUSB{n}: gone") for n in (3, 4, 5)]
    ((trouble,), more) = troubles(states)
    assert (trouble.robots, trouble.kind, trouble.link) == (3, "ugv", "serial:/dev/ttyUSB3 and 2 more")
    assert (trouble.cause, trouble.names, more) == ("gone", ("rover-3", "rover-4", "rover-5"), 0)


def test_causes_that_differ_in_figures_or_the_robots_name_are_one():
    states = [robot("a", cause="a is silent for 3.1 s"), robot("b", cause="b is silent for 7 s")]
    ((trouble,), _) = troubles(states)
    assert (trouble.robots, trouble.cause) == (2, "ROBOT is silent for 3.1 s")


def test_robots_on_different_links_of_the_file_are_apart_and_those_on_one_together():
    links = {"a": "udpin:0.0.0.0:14550", "b": "udpin:0.0.0.0:14550", "c": "can:can0"}
    found, _ = troubles([robot("a"), robot("b"), robot("c")], links=links)
    assert sorted((each.link, each.robots) for each in found) == [("can:can0", 1), ("udpin:0.0.0.0:14550", 2)]


def test_robots_of_several_kinds_have_none():
    ((trouble,), _) = troubles([robot("a"), robot("b", adapter="mavlink")])
    assert (trouble.robots, trouble.kind) == (2, "")


def test_the_oldest_comes_first_and_keeps_its_time_while_it_lasts():
    onsets = Onsets()
    troubles([robot("a"), robot("b", "ok")], onsets=onsets, now=100.0)
    found, _ = troubles([robot("a"), robot("b", "fault", "hot")], onsets=onsets, now=200.0)
    assert [(each.names, each.since) for each in found] == [(("a",), 100.0), (("b",), 200.0)]
    troubles([robot("a", "ok"), robot("b", "ok")], onsets=onsets, now=300.0)
    found, _ = troubles([robot("a"), robot("b", "ok")], onsets=onsets, now=400.0)
    assert [each.since for each in found] == [400.0]


def test_a_problem_of_the_edge_itself_has_no_robots_and_keeps_its_time_though_its_figures_change():
    onsets = Onsets()
    troubles([], [Health(Level.DEGRADED, "disk 93 % full")], onsets=onsets, now=100.0)
    ((trouble,), _) = troubles(
        [], [Health(Level.DEGRADED, "disk 94 % full"), Health()], onsets=onsets, now=200.0
    )
    assert (trouble.robots, trouble.cause, trouble.since) == (0, "disk 94 % full", 100.0)


def test_only_the_worst_are_listed_and_the_others_counted():
    states = [robot(f"r{n}", "degraded", f"cause {chr(97 + n)}") for n in range(LISTED + 2)]
    found, more = troubles([*states, robot("z", "fault", "dead")])
    assert (len(found), more) == (LISTED, 3)
    assert ("z",) in [each.names for each in found]


def test_measured_figures_are_folded_and_names_of_devices_are_not():
    assert folded("silent for 3.1 s on /dev/ttyUSB3") == "silent for # s on /dev/ttyUSB3"


states = st.lists(
    st.builds(
        robot,
        st.from_regex(r"[a-z][a-z0-9_-]{0,62}", fullmatch=True),
        st.sampled_from(["ok", "degraded", "offline", "fault"]),
        st.text(),
        st.text(),
    ),
    unique_by=lambda state: state.name,
)


@given(states)
def test_whatever_robots_say_makes_a_summary_that_others_can_read(states):
    found, more = troubles(states)
    counted = sum(each.robots for each in found)
    assert counted <= sum(state.health != "ok" for state in states)
    assert more or counted == sum(state.health != "ok" for state in states)
    decode(encode(Summary("yard", "1", 1.0, 1.0, troubles=found, more=more)), "yard")
