"""Contradictions between the robots of a fleet file, each reported at its place."""

from types import SimpleNamespace
from uuid import UUID

import pytest

from fleet.config.checks import (
    MOST_NAMED,
    check_followers,
    check_robots,
    warn_of_adapters,
    warn_of_batteries,
    warn_of_drop_ins,
    warn_of_places,
)
from fleet.robot_config import Accepts, AdapterConfig, BatteryPolicy, WorldOrigin

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
LED = Accepts(command=frozenset({"tele", "edge_leader"}))


class Robot(AdapterConfig):
    link: str = "x"


def robots(*given):
    """Return robots with these fields, by index."""
    return {
        index: Robot(**{"name": f"r{index}", "twin": UUID(int=index + 1), **fields})
        for index, fields in enumerate(given)
    }


def listing(count):
    return "robots:\n" + "".join(f"  - {{name: r{index}}}\n" for index in range(count))


def told(problems):
    """Return each problem as ``line: path: message (hint)``."""
    return [f"{each.line}: {str(each).partition(': ')[2]}" for each in problems]


# -- robots -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "same",
    [TWIN, TWIN.upper(), TWIN.replace("-", ""), f"'{{{TWIN}}}'", f"urn:uuid:{TWIN}"],
)
def test_robots_with_the_same_twin_are_reported_at_the_later_one_in_any_spelling(reading, same):
    document = reading(f"robots:\n  - {{name: a, twin: {TWIN}}}\n  - {{name: b, twin: {same}}}\n")
    check_robots(document.data["robots"], {}, document)
    (problem,) = told(document.problems)
    assert problem.startswith("3: robots[1].twin: robots[0] (")
    assert problem.endswith("fleet.yaml:2) has the same twin (give each robot a twin of its own)")


def test_each_later_robot_is_compared_with_the_first(reading):
    document = reading("robots:\n  - {name: a}\n  - {name: a}\n  - {name: b}\n  - {name: a}\n")
    check_robots(document.data["robots"], {}, document)
    assert [(each.line, each.path) for each in document.problems] == [
        (3, "robots[1].name"),
        (5, "robots[3].name"),
    ]
    assert all("robots[0] (" in each.message for each in document.problems)


def test_robots_at_the_same_link_are_reported_there_or_at_the_robot(reading):
    document = reading("robots:\n  - {link: x}\n  - {link: x}\n  - {name: c}\n")
    check_robots(document.data["robots"], {0: "x", 1: "x", 2: "x"}, document)
    assert [(each.line, each.path) for each in document.problems] == [(3, "robots[1].link"), (4, "robots[2]")]
    assert "several vehicles on one link have each its own system_id" in document.problems[0].hint


@pytest.mark.parametrize("text", ["robots: 5\n", "robots: [1, {name: [a]}, {name: [a]}, {twin: x}]\n"])
def test_what_is_no_robot_is_no_contradiction(reading, text):
    document = reading(text)
    check_robots(document.data["robots"], {}, document)
    assert document.problems == []


def test_an_adapter_that_a_later_fleet_refuses_is_warned_of_at_its_first_robot(reading):
    document = reading("robots:\n  - {adapter: new}\n  - {adapter: old}\n  - {adapter: old}\n")
    old, new = SimpleNamespace(name="old", report="it is old"), SimpleNamespace(name="new", report="")
    warn_of_adapters({0: new, 1: old, 2: old}, document)
    assert told(document.warnings) == ["3: robots[1].adapter: it is old"]


@pytest.mark.parametrize(("low", "reserve", "warned"), [(20, 15, False), (15, 15, False), (14.5, 15, True)])
def test_a_battery_that_acts_below_its_reserve_is_warned_of(reading, low, reserve, warned):
    document = reading(f"robots:\n  - battery_policy: {{low: {low}}}\n  - {{}}\n")
    warn_of_batteries(robots({"battery_policy": BatteryPolicy(low=low, reserve=reserve)}, {}), document)
    expected = f"2: robots[0].battery_policy.low: low ({low:g} %) is below reserve ({reserve:g} %)"
    assert [each.startswith(expected) for each in told(document.warnings)] == [True] * warned


def test_a_low_that_the_file_does_not_say_is_warned_of_at_the_policy_or_at_the_robot(reading):
    document = reading("robots:\n  - battery_policy: {reserve: 30}\n  - {}\n")
    policy = {"battery_policy": BatteryPolicy(reserve=30)}
    warn_of_batteries(robots(policy, policy), document)
    assert [each.path for each in document.warnings] == ["robots[0].battery_policy", "robots[1]"]


def test_a_robot_that_follows_a_follower_or_a_simulation_is_reported(reading):
    document = reading("robots:\n  - {}\n  - {follows: x}\n  - {}\n  - {link: sim}\n  - {follows: y}\n")
    found = robots(
        {},
        {"follows": UUID(int=1), "accepts": LED},
        {"follows": UUID(int=2), "accepts": LED},
        {"link": "sim:x"},
        {"follows": UUID(int=4), "accepts": LED},
    )
    check_followers(found, document)
    assert told(document.problems) == [
        "4: robots[2]: r1 follows another robot itself (follow that one)",
        "6: robots[4].follows: r3 is simulated (a simulated robot moves no real one; follow a real one)",
    ]


def test_a_simulation_may_follow_a_simulation_and_a_leader_may_be_of_another_edge(reading):
    document = reading(listing(3))
    found = robots(
        {"link": "sim:x"},
        {"link": "sim:y", "follows": UUID(int=1), "accepts": LED},
        {"follows": UUID(int=77), "accepts": LED},
    )
    check_followers(found, document)
    assert document.problems == []


def test_a_drop_in_file_in_the_edges_own_process_is_warned_of(reading):
    document = reading("robots:\n  - {worker: main}\n  - {worker: arms}\n  - {}\n")
    warn_of_drop_ins(robots({"worker": "main"}, {"worker": "arms"}, {"worker": "main"}), document)
    assert [each.path for each in document.warnings] == ["robots[0].worker", "robots[2]"]
    assert "the drop-in file of r0 runs in the edge's own process" in document.warnings[0].message


# -- places -------------------------------------------------------------------------------------------

PLACED = {"origin": WorldOrigin(latitude=1, longitude=2)}
STARTED = {"start": (0.0, 0.0, 0.0)}


def places(reading, *given, at_home=(), has_site=False, has_partners=False):
    document = reading(listing(len(given)))
    warn_of_places(robots(*given), at_home, has_site=has_site, has_partners=has_partners, document=document)
    return [(each.path, each.message.partition(": ")[0]) for each in document.warnings]


def test_a_robot_that_cannot_be_placed_beside_others_is_warned_of(reading):
    assert places(reading, {}, PLACED, STARTED, {}, at_home=[3], has_site=True) == [
        ("robots[0]", "it cannot be placed beside the others")
    ]


def test_a_single_robot_needs_no_place_unless_there_are_partners(reading):
    assert places(reading, {}) == []
    assert places(reading, {}, has_partners=True) == [("robots[0]", "it cannot be placed beside the others")]


@pytest.mark.parametrize(("count", "warnings"), [(MOST_NAMED, MOST_NAMED), (MOST_NAMED + 1, 1)])
def test_many_robots_without_a_place_are_one_warning(reading, count, warnings):
    found = places(reading, *[{}] * count)
    assert len(found) == warnings
    others = "it and 5 other robots" if warnings == 1 else "it"
    assert found[0] == ("robots[0]", f"{others} cannot be placed beside the others")


def test_a_start_says_nothing_about_earth_without_a_site(reading):
    unknown = [("robots[0]", "the position of its start on Earth is unknown")]
    assert places(reading, STARTED, PLACED) == unknown
    assert places(reading, STARTED, {}, at_home=[1]) == unknown
    assert places(reading, STARTED, has_partners=True) == unknown
    assert places(reading, STARTED, STARTED) == []
    assert places(reading, STARTED, PLACED, has_site=True) == []
