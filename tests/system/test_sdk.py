"""The published Cyberwave SDK flies a drone and reads its state, with nothing of ours on its side."""

import json
import math
import socket
import subprocess
import sys
import uuid

import pytest
from cyberwave import Cyberwave
from cyberwave.twin.factory import create_twin

from tests.tools.ports import free_ports
from tests.tools.sdk import back_end, drive, end
from tests.tools.waiting import DEADLINE, wait_until

DRONE_ASSET = "dji/mini-4-pro"
TWIN = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8a"
IDENTITIES = {
    "asset_uuid": str(uuid.uuid4()),
    "environment_uuid": str(uuid.uuid4()),
    "controller_policy_uuid": str(uuid.uuid4()),
}


@pytest.fixture(scope="module")
def autopilot():
    """Start an autopilot that is there before the fleet and knows nothing of it; gives its target port."""
    (port,) = free_ports(1, socket.SOCK_DGRAM)
    command = [sys.executable, "-m", "fleet_mavlink.sim", "--flavour", "px4", "--to", f"127.0.0.1:{port}"]
    with subprocess.Popen([*command, "--ready-after", "2"], stdout=subprocess.DEVNULL) as running:
        yield port
        running.terminate()


@pytest.fixture
def backend(subscriber, shared_broker):
    """Start what stands for the back end; gives its address and a subscriber to the twin."""
    listener = subscriber("127.0.0.1", shared_broker.port, f"cyberwave/twin/{TWIN}/#")
    with back_end(listener.publish) as address:
        yield address, listener


@pytest.fixture(scope="module")
def edge(shared_fleet, shared_broker, autopilot, shared_folder):
    """Run a fleet of one drone as a user does, for all tests."""
    file = {
        "edge": {"id": "yard"},
        "cloud": {"host": "127.0.0.1", "port": shared_broker.port, "tls": False},
        "robots": [
            {
                "name": "kestrel",
                "twin": TWIN,
                "adapter": "mavlink",
                "link": f"udpin:127.0.0.1:{autopilot}",
                "failsafes": "set",
            }
        ],
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(file))
    running = shared_fleet("run", "--json", folder=shared_folder)
    running.robot("kestrel", "is well", lambda state: state["health"] == "ok")
    return running


@pytest.fixture
def drone(edge, backend, shared_broker, monkeypatch):
    """Make the SDK's twin object for the drone, in live mode."""
    monkeypatch.setenv("CYBERWAVE_SDK_AUTO_ATTACH_CONTROLLER", "0")
    client = Cyberwave(
        base_url=backend[0],
        api_key="cw_test",
        mqtt_host="127.0.0.1",
        mqtt_port=shared_broker.port,
        topic_prefix="",
    )
    data = {
        "uuid": TWIN,
        "name": "kestrel",
        **IDENTITIES,
        "metadata": {"controller_type": "teleop"},
    }
    client.mqtt.connect()  # the SDK stamps a command before it connects: a slow connect would age the first
    yield create_twin(client, data, registry_id=DRONE_ASSET), client, backend[1]
    end(client)


def test_the_sdk_takes_off_moves_navigates_and_lands(edge, drone):
    twin, client, subscriber = drone
    wait_until("the drone to be ready", lambda: ready(subscriber), within=60)
    assert client.mqtt.request_command(twin.uuid, "takeoff", {"altitude": 3.0}, source_type="tele")[
        "status"
    ] == ("accepted")
    # PX4 hovers before its take-off is over: it climbs on to its height, and is busy as long.
    edge.robot("kestrel", "is up", lambda state: ended(state) == ("takeoff", "done"))
    assert height(twin) > 2.5

    before = twin.get_pose()["position"]

    def stops():
        return len(answers(subscriber, "stop"))

    drive(lambda: twin.move_forward(1.0), lambda: apart(twin.get_pose()["position"], before) > 0.5, stops)
    heading = yaw(twin)
    drive(lambda: twin.turn_left(0.8), lambda: turned(yaw(twin), heading) > 0.3, stops)
    goal = twin.navigation.goto([2.0, 1.0, 4.0])
    assert twin.navigation.wait_for_completion(goal["action_id"])["status"] == "completed"
    assert apart(twin.get_pose()["position"], {"x": 2.0, "y": 1.0, "z": 4.0}) < 1.0

    twin.flight.ascend(1.0)
    wait_until("a metre higher", lambda: height(twin) > 4.6)
    twin.land()
    wait_until("the ground", lambda: height(twin) < 0.3)


def test_the_sdk_reads_the_battery_by_its_catalog(drone):
    twin, client, subscriber = drone
    wait_until("a battery status", lambda: subscriber.of("battery/status"))
    topics = {"cyberwave/twin/{twin_uuid}/battery/status": {"direction": "publish"}}
    catalog = {"schema_version": 1, "topics": topics, "commands": {"supported": ["battery_check"]}}
    data = {"uuid": twin.uuid, "name": "kestrel", "metadata": {"controller_type": "teleop", "mqtt": catalog}}
    reader = create_twin(client, {**IDENTITIES, **data}, registry_id=DRONE_ASSET)
    power = reader.power.get(timeout=DEADLINE)
    assert 0 < power["percentage"] <= 100


def test_the_sdk_learns_why_a_command_is_refused(drone):
    twin, client, _ = drone
    answer = client.mqtt.request_command(twin.uuid, "takeoff", {"altitude": 3000.0}, source_type="tele")
    assert answer["status"] == "denied", answer
    assert "120 m" in answer["reason"]
    answer = client.mqtt.request_command(twin.uuid, "sit_down", {}, source_type="tele")
    assert answer["status"] == "rejected"


def ready(subscriber):
    """Say whether the autopilot says that it can be armed."""
    reports = subscriber.of("flight_controller")
    return bool(reports) and reports[-1].get("ready_to_arm")


def ended(state):
    """Return a robot's last command and how it ended."""
    return state.get("last_command"), state.get("last_outcome")


def answers(subscriber, name):
    """Return the answers to a command."""
    return [each for each in subscriber.of("command") if "status" in each and each["command"] == name]


def height(twin):
    pose = twin.get_pose()
    return pose["position"]["z"] if pose else 0.0


def yaw(twin):
    turn = twin.get_pose()["rotation"]
    return math.atan2(
        2 * (turn["w"] * turn["z"] + turn["x"] * turn["y"]), 1 - 2 * (turn["y"] ** 2 + turn["z"] ** 2)
    )


def turned(now, before):
    return math.remainder(now - before, math.tau)


def apart(one, other):
    return math.dist([one[axis] for axis in "xyz"], [other[axis] for axis in "xyz"])
