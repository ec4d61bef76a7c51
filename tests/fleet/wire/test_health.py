import json
from types import SimpleNamespace

from cyberwave.edge.health import EdgeHealthCheck

from fleet.model.state import EdgeState, RobotState
from fleet.wire.health import MOST_UNWELL, edge_health, edge_state

BASE = {
    "twin": "t",
    "edge_id": "yard-1",
    "uptime": 12.34,
    "stamp": 5.0,
    "source_type": "edge",
    "session": "s",
}


def beat(extra):
    return json.loads(edge_health(**BASE, extra=extra))


def test_a_heartbeat_has_the_fields_and_the_order_of_the_sdks():
    extra = {"host_memory_percent": 41.5, "cpu_temp_c": 50.0}
    sdk = EdgeHealthCheck(SimpleNamespace(), ["t"], edge_id="yard-1", host_metrics_provider=lambda: extra)
    expected = [*sdk.build_payload(), "twin_uuid", "session_id"]
    assert list(beat(extra)) == expected
    assert beat(extra) == {
        **sdk.build_payload(),
        "timestamp": 5.0,
        "uptime_seconds": 12.3,
        "twin_uuid": "t",
        "session_id": "s",
    }


def test_without_streams_the_map_is_empty_and_not_missing():
    message = beat({})
    assert (message["type"], message["streams"], message["stream_count"]) == ("edge_health", {}, 0)


def test_a_host_figure_replaces_nothing_else():
    assert beat({"type": "x", "source_type": "tele", "session_id": "other", "twin_uuid": "y"}) == beat({})


def test_what_the_host_cannot_measure_is_left_out_and_stops_no_heartbeat():
    assert beat({"cpu_temp_c": float("nan"), "host_memory_percent": None, "load": 1}) == {
        **beat({}),
        "load": 1,
    }


def test_an_empty_session_is_left_out():
    assert "session_id" not in json.loads(edge_health(**{**BASE, "session": ""}, extra={"session_id": "x"}))


def test_an_edges_own_roll_up_counts_its_robots_and_names_those_that_are_not_well():
    robots = [RobotState("max", "t1", "toy", "yard-1", 5.0, "ok")]
    robots += [RobotState(f"rex-{n}", "t2", "toy", "yard-1", 5.0, "offline", "unplugged") for n in range(60)]
    state = EdgeState("yard-1", "0.1", 5.0, 12.34, "degraded", "rex-0 offline: unplugged", load=0.5)
    message = json.loads(edge_state(state, robots, session="s"))
    assert (message["type"], message["edge_id"], message["timestamp"], message["session_id"]) == (
        "edge_state",
        "yard-1",
        5.0,
        "s",
    )
    assert (message["health"], message["cause"], message["load"]) == (
        "degraded",
        "rex-0 offline: unplugged",
        0.5,
    )
    assert message["unwell"][0] == {
        "name": "rex-0",
        "twin_uuid": "t2",
        "health": "offline",
        "cause": "unplugged",
    }
    assert len(message["unwell"]) == MOST_UNWELL
