"""What a claim in the cloud may do: keep a robot out that nobody uses, never take one from who moves it."""

import asyncio
import json
from types import SimpleNamespace

import paho.mqtt.publish
import pytest

from fleet.host.edge.cloud_claims import CloudClaims

TWIN = "t1"


class Robot:
    name = "rex"
    in_use = False


@pytest.fixture
def robot():
    return Robot()


@pytest.fixture
def bench(robot):
    held, messages = [], []
    claims = CloudClaims({TWIN: robot}, hold=lambda *each: held.append(each), tell=messages.append)
    return SimpleNamespace(claims=claims, held=held, messages=messages)


def test_a_robot_that_nobody_uses_is_kept_out_until_the_claim_ends(bench):
    bench.claims.handle_claim(TWIN, "yard-0")
    bench.claims.handle_claim(TWIN, "")
    assert bench.held == [(TWIN, "yard-0"), (TWIN, "")]
    assert [json.loads(message) for message in bench.messages] == [{TWIN: "yard-0"}, {TWIN: ""}]
    assert bench.claims.problem == ""


def test_a_robot_in_use_is_kept_and_the_claim_reported(bench, robot, caplog):
    robot.in_use = True
    bench.claims.handle_claim(TWIN, "yard-0")
    assert (bench.held, bench.messages) == ([], [])
    assert "edge yard-0 says in the cloud that it has rex (not believed" in bench.claims.problem
    assert "not believed" in caplog.text
    bench.claims.handle_claim(TWIN, "")
    assert bench.claims.problem == ""


def forged(twin):
    """Return heartbeats of an edge that nobody has, older than any."""
    message = {"type": "edge_health", "edge_id": "evil", "uptime_seconds": 1e9, "session_id": "x"}
    return [(f"cyberwave/twin/{twin}/edge_health", json.dumps(message), 1, False)] * 5


@pytest.mark.parametrize("worker", ["main", "legs"])
async def test_forged_heartbeats_do_not_interrupt_an_operator(yard, run_edge, requests, broker, worker):
    place = yard(rex={"worker": worker, "setpoint_lease": 5.0})
    place.change(cloud={"host": "127.0.0.1", "port": broker.port, "tls": False})
    edge = place.edge()
    (robot,) = edge.robots()
    topic = f"cyberwave/twin/{robot.twin}/command"
    drive = json.dumps({"command": "move_forward", "source_type": "tele", "data": {"linear_x": 1.0}})

    async def send(messages):
        await asyncio.to_thread(paho.mqtt.publish.multiple, messages, hostname="127.0.0.1", port=broker.port)

    async def drives():
        """Drive, and wait until the robot is told so once more."""
        before = place.words("rex").count("drive:1")
        await send([(topic, drive, 1, False)])
        await requests.until(lambda: place.words("rex").count("drive:1") > before)

    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok", 40)
        await requests.until(lambda: edge.state().cloud == "connected")
        await drives()
        await requests.until(lambda: edge.states()[0].in_use)
        await send(forged(robot.twin))
        await requests.until(lambda: "edge evil says" in edge.state().cause)
        await drives()
        assert set(place.words("rex")) == {"run", "drive:1"}
        assert edge.states()[0].health == "ok"
