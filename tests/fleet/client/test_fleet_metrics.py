"""The metrics of a fleet view, as a scraper reads them."""

import pytest

from fleet.client.fleet_metrics import FleetMetrics
from fleet.errors import MetricsError
from fleet.health.rollup import Reach, SeenEdge
from fleet.model.summary import Summary, Trouble
from fleet.testing.clock import ManualClock
from tests.tools.scraping import scraped

CAUSE = "No such device; is it plugged in?"
HUB = Trouble("offline", CAUSE, 1.0, 3, "ugv", "serial:/dev/ttyUSB3", ("a",))


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def metrics(clock):
    metrics = FleetMetrics(clock)
    metrics.serve(0)
    return metrics


def up(metrics):
    return {key[1:]: value for key, value in scraped(metrics.port).items() if key[0] == "fleet_edge_up"}


def test_a_scraper_reads_all_edges_also_those_that_are_gone(metrics, clock):
    now = clock.time()
    summary = Summary("b", "1.0", now, 1.0, "north", robots={"ok": 17, "offline": 3}, troubles=(HUB,))
    metrics.update([SeenEdge("b", True, now, summary, now), SeenEdge("c", False, now, summary, now)])
    seen = scraped(metrics.port)
    assert (seen["fleet_edge_up", "b", Reach.UP], seen["fleet_edge_up", "c", Reach.GONE]) == (1, 0)
    assert seen["fleet_edge_robots", "b", "offline"] == 3
    assert ("fleet_edge_robots", "c", "offline") not in seen, "nobody knows"
    assert seen["fleet_trouble_robots", CAUSE, "b", "ugv", "offline", "serial:/dev/ttyUSB3"] == 3


def test_before_the_first_look_there_are_no_edges(metrics):
    assert up(metrics) == {}


def test_what_is_read_is_as_old_as_the_last_look_and_ages_by_the_clock(metrics, clock):
    now = clock.time()
    metrics.update([SeenEdge("b", True, now, Summary("b", "1.0", now, 1.0), now)])
    assert up(metrics) == {("b", Reach.UP): 1.0}
    clock.advance(3600.0)
    assert up(metrics) == {("b", Reach.SILENT): 0.0}
    metrics.update([])
    assert up(metrics) == {}


def test_a_port_that_is_taken_is_refused_with_the_option_that_asked_for_it(metrics, clock):
    with pytest.raises(MetricsError) as caught:
        FleetMetrics(clock).serve(metrics.port)
    assert (
        str(caught.value) == f"--metrics: 127.0.0.1:{metrics.port} cannot be opened: Address already in use"
    )
