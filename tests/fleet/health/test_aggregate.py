import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.health.aggregate import LEVELS, edge_health, robots_by_health
from fleet.model.health import Health, Level
from fleet.model.state import RobotState

words = st.sampled_from(sorted(LEVELS))


def robot(health, name="rex", cause="why"):
    return RobotState(name, "", "toy", "yard", 0.0, health=health, cause="" if health == "ok" else cause)


def test_an_edge_without_robots_and_troubles_is_well():
    assert edge_health([], []) == Health()


def test_robots_that_are_well_say_nothing():
    assert edge_health([robot("ok"), robot("ok")], [Health()]) == Health()


@pytest.mark.parametrize("health", ["degraded", "offline", "fault"])
def test_a_robot_alone_only_degrades_its_edge_and_is_named(health):
    assert edge_health([robot("ok", "a"), robot(health, "b")], []) == Health(
        Level.DEGRADED, f"b {health}: why"
    )


def test_the_worst_robot_is_the_cause():
    states = [robot("degraded", "a"), robot("offline", "b"), robot("fault", "c"), robot("offline", "d")]
    assert edge_health(states, [Health(Level.DEGRADED, "cloud disconnected")]).cause == "c fault: why"


def test_of_equals_the_first_is_the_cause():
    assert edge_health([robot("offline", "a"), robot("offline", "b")], []).cause == "a offline: why"


def test_what_an_edge_rests_on_counts_in_full():
    refused = Health(Level.FAULT, "cloud refused: bad password")
    assert edge_health([robot("fault")], [Health(), refused]) == refused


@given(st.lists(words), st.lists(st.sampled_from(list(Level))))
def test_an_edge_is_as_bad_as_the_worst_it_rests_on_or_degraded_by_a_robot(robots, levels):
    health = edge_health(
        [robot(word) for word in robots], [Health(level, "x" if level else "") for level in levels]
    )
    worst_robot = Level.DEGRADED if any(word != "ok" for word in robots) else Level.OK
    assert health.level == max([*levels, worst_robot])
    assert bool(health.cause) == (health.level is not Level.OK)


@given(st.lists(words))
def test_robots_are_counted_by_health_the_best_first_and_none_for_nothing(robots):
    counts = robots_by_health(robot(word) for word in robots)
    assert counts == {word: robots.count(word) for word in LEVELS if word in robots}
    assert list(counts) == sorted(counts, key=LEVELS.__getitem__)
