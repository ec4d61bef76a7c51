"""The published Cyberwave SDK drives a simulated Beast and reads where it is."""

import json
import math
import subprocess
import sys
import uuid

import pytest
from cyberwave import Cyberwave
from cyberwave.twin.factory import create_twin

from tests.tools.sdk import drive, end
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8b"
SQUARE = ((0.6, 0.0), (0.6, 0.6), (0.0, 0.6), (0.0, 0.0))


@pytest.fixture
def device():
    """Start a simulated base that knows nothing of the fleet; gives its link."""
    command = [sys.executable, "-m", "fleet_ugv.sim", "--profile", "waveshare-beast"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as running:
        yield json.loads(running.stdout.readline())["url"]
        running.terminate()


@pytest.fixture
def beast(fleet, subscriber, broker, device, tmp_path, monkeypatch):  # noqa: PLR0917 - fixtures
    """Run a fleet of one wheeled robot as a user does, and make the twin object of the SDK in live mode."""
    monkeypatch.setenv("CYBERWAVE_SDK_AUTO_ATTACH_CONTROLLER", "0")
    file = {
        "edge": {"id": "yard"},
        "cloud": {"host": "127.0.0.1", "port": broker.port, "tls": False},
        "robots": [
            {"name": "beast", "twin": TWIN, "adapter": "ugv", "profile": "waveshare-beast", "link": device}
        ],
    }
    (tmp_path / "fleet.yaml").write_text(json.dumps(file))
    listener = subscriber("127.0.0.1", broker.port, f"cyberwave/twin/{TWIN}/#")
    running = fleet("run", "--json", folder=tmp_path)
    running.robot("beast", "is well", lambda state: state["health"] == "ok")
    client = Cyberwave(
        base_url="http://127.0.0.1:9",
        api_key="cw_test",
        mqtt_host="127.0.0.1",
        mqtt_port=broker.port,
        topic_prefix="",
    )
    data = {
        "uuid": TWIN,
        "name": "beast",
        "asset_uuid": str(uuid.uuid4()),
        "environment_uuid": str(uuid.uuid4()),
        "controller_policy_uuid": str(uuid.uuid4()),
        "metadata": {"controller_type": "teleop"},
    }
    yield create_twin(client, data, registry_id="waveshare/ugv-beast"), listener
    end(client)


def test_the_sdk_drives_it_and_a_square_of_goals_closes(beast):
    twin, subscriber = beast
    wait_until("a pose", twin.get_pose)
    start = place(twin)

    def stops():
        return stops_answered(subscriber)

    drive(lambda: twin.move_forward(0.3), lambda: math.dist(place(twin), start) > 0.1, stops)
    drive(lambda: twin.move_backward(0.3), lambda: math.dist(place(twin), start) < 0.1, stops)
    action = uuid.uuid4().hex
    waypoints = [{"id": str(n), "position": {"x": x, "y": y, "z": 0}} for n, (x, y) in enumerate(SQUARE)]
    goal = {"command": "path", "action_id": action, "waypoints": waypoints, "source_type": "tele"}
    subscriber.publish(f"cyberwave/twin/{TWIN}/navigate/command", goal)
    wait_until(
        f"the square; last {subscriber.of('navigate/status')[-1:]}",
        lambda: states(subscriber, action)[-1:] == ["completed"],
        within=90,
    )
    assert math.dist(place(twin), (0.0, 0.0)) < 0.1
    seen = [(each["position"]["x"], each["position"]["y"]) for each in subscriber.of("position")]
    for corner in SQUARE:
        assert min(math.dist(at, corner) for at in seen) < 0.12
    navigations = [each["metrics"]["navigation"] for each in subscriber.of("metrics")]
    inflight = [navigation for navigation in navigations if "eta_seconds" in navigation]
    assert inflight
    assert all(navigation["distance_remaining_m"] <= 4.5 for navigation in inflight)
    assert "distance_remaining_m" not in navigations[0]
    types = [each["type"] for each in subscriber.of("telemetry")]
    types = types[types.index("connected") :]  # before it answered, the edge may have said that it does not
    assert types[:2] == ["connected", "telemetry_start"]
    assert subscriber.of("battery/status")[-1]["percentage"] == pytest.approx(80.8, abs=0.1)


def place(twin):
    at = twin.get_pose()["position"]
    return at["x"], at["y"]


def stops_answered(subscriber):
    return sum(each["command"] == "stop" and "status" in each for each in subscriber.of("command"))


def states(subscriber, action):
    return [each["status"] for each in subscriber.of("navigate/status") if each["action_id"] == action]
