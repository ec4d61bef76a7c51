"""The published Cyberwave SDK stands a dog up, walks it round a square and sits it down."""

import json
import math
import time

import pytest
from cyberwave import Cyberwave

from tests.tools.sdk import end
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8d"


class Operator:
    """A person with the SDK, and a subscriber to the twin's topics."""

    def __init__(self, client, subscriber):
        self.client = client
        self.subscriber = subscriber

    def request(self, command, **data):
        """Send a command; return its receipt."""
        return self.client.mqtt.request_command(TWIN, command, data, source_type="tele")

    def retry_until_accepted(self, command):
        wait_until(f"{command} to be taken", lambda: self.request(command)["status"] == "accepted")

    def position(self):
        place = self.subscriber.of("position")[-1]["position"]
        return place["x"], place["y"]

    def heading(self):
        turn = self.subscriber.of("rotation")[-1]["rotation"]
        return 2 * math.atan2(turn["z"], turn["w"])

    def mode(self):
        navigation = [each["metrics"].get("navigation", {}) for each in self.subscriber.of("metrics")]
        return navigation[-1].get("mode", "") if navigation else ""

    def is_seen(self, mode):
        wait_until(f"the dog to be {mode}", lambda: self.mode() == mode, within=60)

    def hold(self, verb, until, **data):
        """Hold a verb until something is seen."""
        receipt = {}

        def again():
            receipt.update(self.request(verb, **data))
            time.sleep(0.1)  # as often as a thumb on a stick
            return until()

        try:
            wait_until(f"{verb} to be seen", again, within=60)
        except AssertionError as error:
            error.add_note(f"the last answer was {receipt}")
            raise


@pytest.fixture(scope="module")
def yard(shared_fleet, shared_broker, shared_folder):
    """Run a dog in physics for all tests of it; gives the broker's port."""
    dog = {"name": "rex", "twin": TWIN, "adapter": "quadruped", "link": "sim:mujoco"}
    accepts = {"command": ["tele"], "navigate": ["tele"]}
    file = {
        "edge": {"id": "yard"},
        "cloud": {"host": "127.0.0.1", "port": shared_broker.port, "tls": False},
        "robots": [dog | {"accepts": accepts}],
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(file))
    running = shared_fleet("run", "--json", folder=shared_folder)
    running.robot("rex", "is well", lambda state: state["health"] == "ok")
    return shared_broker.port


@pytest.fixture
def operator(yard, subscriber, monkeypatch):
    """Connect a person to the dog, which is where the test before has left it."""
    monkeypatch.setenv("CYBERWAVE_SDK_AUTO_ATTACH_CONTROLLER", "0")
    listener = subscriber("127.0.0.1", yard, f"cyberwave/twin/{TWIN}/#")
    client = Cyberwave(
        base_url="http://127.0.0.1:9",
        api_key="cw_test",
        mqtt_host="127.0.0.1",
        mqtt_port=yard,
        topic_prefix="",
    )
    client.mqtt.connect()
    yield Operator(client, listener)
    end(client)


@pytest.mark.timeout(300)
def test_the_sdk_walks_a_dog_round_a_square(operator):
    operator.retry_until_accepted("stand_up")
    operator.is_seen("standing")
    start = operator.position()
    for _ in range(4):
        corner, heading = operator.position(), operator.heading()
        operator.hold(
            "move_forward", lambda corner=corner: math.dist(operator.position(), corner) > 0.5, linear_x=0.4
        )
        operator.hold(
            "turn_left",
            lambda heading=heading: math.remainder(operator.heading() - heading, math.tau) > 1.3,
            angular_z=0.8,
        )
        assert operator.request("stop")["status"] == "accepted"
    assert math.dist(operator.position(), start) < 1.0
    operator.retry_until_accepted("sit_down")
    operator.is_seen("off")


def test_an_emergency_stop_over_the_cloud_ends_in_a_named_fault_until_it_is_released(operator):
    operator.retry_until_accepted("stand_up")
    operator.is_seen("standing")
    operator.hold("move_forward", lambda: operator.mode() == "walking", linear_x=0.3)
    assert operator.request("emergency_stop")["status"] == "accepted"
    operator.is_seen("off")
    assert operator.request("stand_up")["status"] != "accepted"
    assert operator.request("release_emergency_stop")["status"] == "accepted"
    operator.retry_until_accepted("stand_up")
    operator.is_seen("standing")
