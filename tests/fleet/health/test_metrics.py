"""The metrics of edges, as Prometheus reads them."""

import pytest
from prometheus_client import CollectorRegistry, generate_latest

from fleet.health.metrics import fleet_metrics, summary_metrics
from fleet.health.rollup import SILENT_AFTER, SeenEdge
from fleet.model.summary import Summary, Trouble

YARD = Summary(
    "yard",
    "1.0",
    100.0,
    60.0,
    site="north",
    health="degraded",
    robots={"ok": 2, "offline": 1},
    stopped=1,
    troubles=(
        Trouble("offline", "no answer for 5 s", 90.0, 1, "toy", "udp:x"),
        Trouble("offline", "no answer for 7 s", 80.0, 2, "toy", "udp:x"),
        Trouble("fault", "disk full", 70.0),
    ),
    more=4,
)


def named(edge):
    return Summary(edge, "1.0", 1.0, 1.0)


def samples(metrics):
    """Return the values of metrics by name and labels."""
    return {
        (sample.name, *(f"{key}={value}" for key, value in sample.labels.items())): sample.value
        for metric in metrics
        for sample in metric.samples
    }


def test_a_summary_is_a_set_of_figures_by_edge():
    found = samples(summary_metrics([YARD]))
    edge = "edge=yard"
    assert found["fleet_edge_info", edge, "version=1.0", "site=north"] == 1.0
    assert found["fleet_edge_stopped_robots", edge] == 1.0
    assert found["fleet_trouble_unlisted", edge] == 4.0
    robots = {
        word: found["fleet_edge_robots", edge, f"health={word}"]
        for word in ("ok", "degraded", "offline", "fault")
    }
    assert robots == {"ok": 2.0, "degraded": 0.0, "offline": 1.0, "fault": 0.0}


@pytest.mark.parametrize(("health", "level"), [("ok", 0), ("degraded", 1), ("offline", 2), ("fault", 3)])
def test_a_health_is_a_number_that_grows_with_the_trouble(health, level):
    found = samples(summary_metrics([Summary("yard", "1.0", 1.0, 1.0, health=health)]))
    assert found["fleet_edge_health", "edge=yard"] == level


def test_causes_that_differ_in_their_figures_are_one_since_the_first_of_them():
    found = samples(summary_metrics([YARD]))
    labels = ("edge=yard", "level=offline", "kind=toy", "link=udp:x", "cause=no answer for # s")
    assert found["fleet_trouble_robots", *labels] == 3.0
    assert found["fleet_trouble_since_seconds", *labels] == 80.0
    own = ("edge=yard", "level=fault", "kind=", "link=", "cause=disk full")
    assert (found["fleet_trouble_robots", *own], found["fleet_trouble_since_seconds", *own]) == (0.0, 70.0)
    assert sum(name == "fleet_trouble_robots" for name, *_ in found) == 2


def test_each_edge_has_figures_of_its_own():
    found = samples(summary_metrics([YARD, Summary("barn", "2.0", 1.0, 1.0)]))
    assert found["fleet_edge_health", "edge=yard"] == 1.0
    assert found["fleet_edge_health", "edge=barn"] == 0.0


def test_without_summaries_there_are_no_figures():
    assert samples(summary_metrics([])) == {}


def test_of_an_edge_that_is_not_up_only_its_reach_is_told():
    now = 1000.0
    seen = [
        SeenEdge("yard", True, 0.0, YARD, heard=now),
        SeenEdge("silent", True, 0.0, named("silent"), heard=now - SILENT_AFTER - 1),
        SeenEdge("gone", False, now, named("gone"), heard=now),
        SeenEdge("unseen", True, 0.0, named("unseen"), heard=now, unseen=now),
        SeenEdge("new", True, now),
    ]
    found = samples(fleet_metrics(seen, now))
    up = {
        labels: value
        for (name, *labels), value in found.items()
        if name == "fleet_edge_up"
        for labels in [tuple(labels)]
    }
    assert up == {
        ("edge=yard", "reach=up"): 1.0,
        ("edge=silent", "reach=silent"): 0.0,
        ("edge=gone", "reach=gone"): 0.0,
        ("edge=unseen", "reach=unseen"): 0.0,
        ("edge=new", "reach=up"): 1.0,
    }
    assert found["fleet_edge_heard_seconds", "edge=yard"] == now
    assert found["fleet_edge_heard_seconds", "edge=new"] == 0.0
    assert [labels for (name, *labels) in found if name == "fleet_edge_health"] == [["edge=yard"]]


def test_prometheus_can_read_them():
    registry = CollectorRegistry()

    class Edges:
        def collect(self):
            return fleet_metrics([SeenEdge("yard", True, 0.0, YARD, heard=1.0)], 1.0)

    registry.register(Edges())
    assert b'fleet_edge_up{edge="yard",reach="up"} 1.0' in generate_latest(registry)
