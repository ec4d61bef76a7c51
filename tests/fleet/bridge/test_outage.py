"""The bridge while the broker is away: nothing that matters is lost, nothing old comes as if it were new."""

import json

import pytest

from fleet.bridge.bridge import Bridge, BridgeRules
from fleet.clock import SystemClock
from fleet.cloud.client import CloudClient
from fleet.cloud.values import CloudSettings, CloudState
from fleet.model.navigation import ActionState
from fleet.model.report import NavigationReport
from fleet.spool.spool import Spool, SpoolSettings
from fleet.wire.databus import encode_report
from fleet.wire.rulebook import rulebook, twin_rules
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
POSITION = f"cw/{TWIN}/data/position"
STATUS = f"cw/{TWIN}/data/navigate_status"
TELEMETRY = f"cw/{TWIN}/data/telemetry"
UNAVAILABLE = 0x88


def settings(port, name, **more):
    return CloudSettings(
        host="127.0.0.1", port=port, tls=False, client_id=name, refused_backoff=(0.05, 0.1), **more
    )


@pytest.fixture
def heard(background_loop, broker):
    """Hear all there is, as (suffix, message)."""
    heard = []

    def take(messages):
        heard.extend((one.topic.partition(f"{TWIN}/")[2], json.loads(one.payload)) for one in messages)

    client = CloudClient(
        settings(broker.port, "listener"),
        {"cyberwave/#": 1},
        on_message=take,
        on_read=lambda: None,
        on_state=lambda *_: None,
        clock=SystemClock(),
    )
    background_loop.call(client.start)
    wait_until("the listener is in", lambda: client.state is CloudState.CONNECTED)
    yield heard
    client.close()


@pytest.fixture
def make_bridge(background_loop, broker, topics, ports):
    """Build bridges with a spool, and close what is still open."""
    made = []

    def make_bridge(**spool):
        bridge = Bridge(
            settings(broker.port, f"edge-{len(made)}", keepalive=1),  # s: so soon it notices an outage
            topics,
            ports,
            edge="yard-1",
            rules=BridgeRules(dict.fromkeys(ports, twin_rules(rulebook()))),
            put=lambda _key, _sample: None,
            claimed=lambda _twin, _holder: None,
            alive=lambda _name: True,
            clock=SystemClock(),
            spool=Spool(SpoolSettings(**spool), SystemClock()),
        )
        made.append(bridge)
        background_loop.call(bridge.start)
        return bridge

    yield make_bridge
    for bridge in made:
        bridge.client.close()


def in_or_out(bridge, *, connected):
    wait_until("the state changes", lambda: (bridge.client.state is CloudState.CONNECTED) == connected)


def tell_statuses(bridge, first, end):
    for number in range(first, end):
        report = NavigationReport(float(number), f"a{number}", ActionState.RUNNING, 0.0)
        bridge.uplink.arrived(STATUS, encode_report(report, number))
        list(bridge.tick())


def actions(heard):
    return [message["action_id"] for suffix, message in list(heard) if suffix == "navigate/status"]


def test_after_an_outage_the_newest_state_comes_first_and_then_every_status_in_order(
    broker, heard, make_bridge, pose, tmp_path
):
    bridge = make_bridge(folder=tmp_path)
    in_or_out(bridge, connected=True)
    tell_statuses(bridge, 0, 10)
    wait_until("the first are heard", lambda: len(actions(heard)) == 10)
    broker.broker.faults.refuse = UNAVAILABLE
    broker.call(broker.broker.half_open, "edge-0")
    in_or_out(bridge, connected=False)
    for number in range(50):
        bridge.uplink.arrived(POSITION, pose(float(number)))
        tell_statuses(bridge, 10 + number, 11 + number)
    before = len(heard)
    broker.broker.faults.refuse = None
    wait_until("all are heard", lambda: len(actions(heard)) == 60)
    assert actions(heard) == [f"a{number}" for number in range(60)]
    after = [(suffix, message) for suffix, message in heard[before:] if suffix != "telemetry"]
    suffixes = [suffix for suffix, _ in after]
    assert {"position", "rotation"} == set(suffixes[:2])
    assert suffixes.count("position") <= 2
    assert dict(after[:2])["position"]["position"]["x"] == 49.0


@pytest.mark.parametrize(
    "state",
    [{"type": "vehicle_state"}, {"type": "motor_status", "motor_id": 3}, {"type": "driver_info"}],
    ids=lambda state: state["type"],
)
def test_periodic_telemetry_of_an_outage_does_not_come_after_it_as_news(broker, heard, make_bridge, state):
    bridge = make_bridge()
    in_or_out(bridge, connected=True)

    def tell(message):
        bridge.uplink.arrived(TELEMETRY, json.dumps(message).encode())
        list(bridge.tick())

    broker.broker.faults.refuse = UNAVAILABLE
    broker.call(broker.broker.half_open, "edge-0")
    in_or_out(bridge, connected=False)
    for second in range(41):
        tell({**state, "ts": float(second)})
    tell({"type": "authority_lost", "ts": 41.0})
    broker.broker.faults.refuse = None
    wait_until("what happened is heard", lambda: [m for _, m in heard if m.get("type") == "authority_lost"])
    tell({**state, "ts": 100.0})

    def timestamps():
        list(bridge.tick())
        return [message["timestamp"] for _, message in heard if message.get("type") == state["type"]]

    assert wait_until("the state of now is heard", timestamps) == [100.0]


def test_what_an_edge_could_not_send_is_sent_by_the_next_one(broker, heard, make_bridge, tmp_path):
    broker.broker.faults.refuse = UNAVAILABLE
    first = make_bridge(folder=tmp_path)
    tell_statuses(first, 0, 50)
    first.client.close(0.0)
    broker.broker.faults.refuse = None
    second = make_bridge(folder=tmp_path)
    tell_statuses(second, 50, 60)
    wait_until("all are heard", lambda: len(actions(heard)) == 60)
    assert actions(heard) == [f"a{number}" for number in range(60)]


def test_what_was_lost_is_reported_on_the_twins_telemetry(broker, heard, make_bridge):
    broker.broker.faults.refuse = UNAVAILABLE
    bridge = make_bridge(messages=10)
    tell_statuses(bridge, 0, 60)
    broker.broker.faults.refuse = None
    wait_until("the rest is heard", lambda: len(actions(heard)) == 10)
    in_or_out(bridge, connected=True)
    for _ in range(2):
        bridge.beat({})
    wait_until("the gap is told", lambda: [m for suffix, m in heard if m.get("type") == "gap"])
    (gap,) = [message for suffix, message in heard if message.get("type") == "gap"]
    assert (gap["leaf"], gap["reason"], gap["lost"]) == ("navigate/status", "room", 50)
    assert bridge.client.stats.dropped == 50
