"""Summaries of edges as Prometheus metrics: an edge's own, and those of all edges of a fleet view."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from prometheus_client.core import GaugeMetricFamily, Metric

from fleet.health.causes import folded
from fleet.health.rollup import LEVELS, Reach, SeenEdge
from fleet.model.summary import Summary

CAUSE = ("edge", "level", "kind", "link", "cause")


def summary_metrics(summaries: Iterable[Summary]) -> Iterator[Metric]:
    """Yield the metrics of summaries. Times are by the clocks of their edges."""
    info = GaugeMetricFamily(
        "fleet_edge_info", "1, with version and site.", labels=["edge", "version", "site"]
    )
    health = GaugeMetricFamily("fleet_edge_health", "0 ok, 1 degraded, 2 offline, 3 fault.", labels=["edge"])
    robots = GaugeMetricFamily("fleet_edge_robots", "Robots by health.", labels=["edge", "health"])
    stopped = GaugeMetricFamily(
        "fleet_edge_stopped_robots", "Robots with an emergency stop set.", labels=["edge"]
    )
    troubled = GaugeMetricFamily(
        "fleet_trouble_robots", "Robots with one cause; 0: the edge itself has it.", labels=CAUSE
    )
    began = GaugeMetricFamily(
        "fleet_trouble_since_seconds", "Unix time since which there is the cause.", labels=CAUSE
    )
    more = GaugeMetricFamily(
        "fleet_trouble_unlisted", "Causes that found no room in the summary.", labels=["edge"]
    )
    for summary in summaries:
        edge = summary.edge
        info.add_metric([edge, summary.version, summary.site], 1.0)
        health.add_metric([edge], float(LEVELS[summary.health]))
        for word in LEVELS:
            robots.add_metric([edge, word], float(summary.robots.get(word, 0)))
        stopped.add_metric([edge], float(summary.stopped))
        more.add_metric([edge], float(summary.more))
        for labels, (number, since) in _troubles(summary).items():
            troubled.add_metric(labels, float(number))
            began.add_metric(labels, since)
    yield from (info, health, robots, stopped, troubled, began, more)


def fleet_metrics(seen: Iterable[SeenEdge], now: float) -> Iterator[Metric]:
    """Yield the metrics of all edges ever seen; of an edge that is not up, only its reachability."""
    up = GaugeMetricFamily("fleet_edge_up", "1 while the edge sends summaries.", labels=["edge", "reach"])
    heard = GaugeMetricFamily(
        "fleet_edge_heard_seconds", "Unix time of its last summary; 0: never.", labels=["edge"]
    )
    summaries = []
    for edge in seen:
        reach = edge.reach(now)
        up.add_metric([edge.edge, reach.value], float(reach is Reach.UP))
        heard.add_metric([edge.edge], edge.heard)
        if reach is Reach.UP and edge.summary is not None:
            summaries.append(edge.summary)
    yield from (up, heard)
    yield from summary_metrics(summaries)


def _troubles(summary: Summary) -> dict[tuple[str, ...], tuple[int, float]]:
    """Return number of robots and time of each cause, by labels without figures, which would be unbounded."""
    found: dict[tuple[str, ...], tuple[int, float]] = {}
    for each in summary.troubles:
        labels = (summary.edge, each.level, each.kind, each.link, folded(each.cause))
        number, since = found.get(labels, (0, each.since))
        found[labels] = (number + each.robots, min(since, each.since))
    return found
