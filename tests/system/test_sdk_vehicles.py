"""The published SDK drives a rover, and flies a plane and a VTOL, as it flies a drone."""

import contextlib
import json
import math
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import pytest
from cyberwave import Cyberwave
from cyberwave.twin.factory import create_twin

from fleet.cli.demo import twin_of
from tests.system.conftest import Pilot, Running, subscribers
from tests.system.test_sdk import DRONE_ASSET, IDENTITIES, ended
from tests.tools.sdk import back_end, drive, end
from tests.tools.waiting import wait_until

ROVER_ASSET = "waveshare/ugv-beast"
LONG = 120.0  # s for what a vehicle does for a minute of its own time
VEHICLES = {
    "mule": ("ardupilot", "rover", "--tcp"),
    "albatross": ("ardupilot", "plane", "--port"),
    "heron": ("px4", "vtol", "--port"),
}


@dataclass
class Driver:
    """One vehicle in the hands of the SDK."""

    name: str
    twin: Any
    client: Any
    pilot: Pilot
    edge: Running

    def requested(self, command: str, **data: object) -> None:
        """Ask for a command until it is taken (its settings are read meanwhile); return once it is done."""

        def taken() -> bool:
            return self.answer(command, **data)["status"] == "accepted"

        wait_until(f"{command} to be taken", taken, within=LONG)
        self.edge.robot(self.name, f"has done {command}", lambda state: ended(state) == (command, "done"))

    def answer(self, command: str, **data: object) -> Any:
        """Ask for a command and return its answer."""
        return self.client.mqtt.request_command(self.twin.uuid, command, data, source_type="tele")

    def goes(self, x: float, y: float, z: float) -> None:
        """Go to a place; return once it is there."""
        goal = self.twin.navigation.goto([x, y, z])
        assert self.twin.navigation.wait_for_completion(goal["action_id"])["status"] == "completed"

    def away(self, x: float, y: float) -> float:
        """Return metres over ground to a place."""
        place = self.twin.get_pose()["position"]
        return math.hypot(place["x"] - x, place["y"] - y)


def robot(name, url):
    """Return the entry of a vehicle. Its goals come from the back end, another operator than the SDK."""
    return {
        "name": name,
        "twin": twin_of(name),
        "adapter": "mavlink",
        "link": url,
        "failsafes": "ignore",
        "takeoff_altitude": 40,
        "control_lease": 0,
        "limits": {"speed": 25, "altitude": 120},
    }


@contextlib.contextmanager
def autopilots():
    """Run the vehicles, which know nothing of the fleet and are 3 km apart; gives the link of each."""
    running, links = [], {}
    for place, (name, (flavour, kind, option)) in enumerate(VEHICLES.items()):
        command = [sys.executable, "-m", "fleet_mavlink.sim", "--flavour", flavour, "--vehicle", kind]
        command += [option, "0", "--home", f"47.4,{8.5 + 0.04 * place},488"]
        command += ["--ready-after", "2", "--speed", "5"]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        links[name] = json.loads(running[-1].stdout.readline())["url"]
    yield links
    for each in running:
        each.terminate()
        each.communicate()


@pytest.fixture(scope="module")
def edge(shared_fleet, shared_broker, tmp_path_factory):
    """Run a fleet of the vehicles as a user does."""
    folder = tmp_path_factory.mktemp("yard")
    with autopilots() as links:
        file = {
            "edge": {"id": "yard"},
            "cloud": {"host": "127.0.0.1", "port": shared_broker.port, "tls": False},
            "robots": [robot(name, links[name]) for name in VEHICLES],
        }
        (folder / "fleet.yaml").write_text(json.dumps(file))
        yield shared_fleet("run", "--json", folder=folder)


@pytest.fixture(scope="module")
def sdk(shared_broker):
    """Connect the SDK; gives its client, and a subscriber to all twins."""
    with pytest.MonkeyPatch.context() as patch, subscribers() as subscriber:
        patch.setenv("CYBERWAVE_SDK_AUTO_ATTACH_CONTROLLER", "0")
        listener = subscriber("127.0.0.1", shared_broker.port, "cyberwave/twin/#")
        with back_end(listener.publish) as address:
            client = Cyberwave(
                base_url=address,
                api_key="cw_test",
                mqtt_host="127.0.0.1",
                mqtt_port=shared_broker.port,
                topic_prefix="",
            )
            client.mqtt.connect()
            yield client, listener
            end(client)


@pytest.fixture
def take(edge, sdk):
    """Take a vehicle with the SDK once it can be armed: ``take(name, asset)``."""
    client, listener = sdk

    def take(name, asset):
        pilot = listener.pilot(twin_of(name))
        data = {"uuid": pilot.twin, "name": name, **IDENTITIES, "metadata": {"controller_type": "teleop"}}
        pilot.wait_for("flight_controller", "it can be armed", lambda state: state.get("ready_to_arm"))
        return Driver(name, create_twin(client, data, registry_id=asset), client, pilot, edge)

    return take


def test_the_sdk_drives_a_rover_by_verbs_and_to_a_goal(take):
    mule = take("mule", ROVER_ASSET)
    mule.requested("arm")
    began = mule.twin.get_pose()["position"]
    drive(
        lambda: mule.twin.move_forward(1.0),
        lambda: mule.away(began["x"], began["y"]) > 0.5,
        lambda: len(mule.pilot.answers("stop")),
    )
    mule.goes(10.0, 5.0, 0.0)
    assert mule.away(10.0, 5.0) < 3.0


def test_the_sdk_flies_a_plane_to_a_goal_that_it_circles(take):
    albatross = take("albatross", DRONE_ASSET)
    albatross.requested("takeoff", altitude=40.0)
    albatross.goes(200.0, 200.0, 50.0)
    assert albatross.away(200.0, 200.0) < 110.0
    answer = albatross.answer("move_forward", linear_x=1.0)
    assert answer["status"] != "accepted"
    assert "circles" in answer["reason"]


def test_the_sdk_flies_a_vtol_in_its_hover_and_on_its_wings(take):
    heron = take("heron", DRONE_ASSET)
    heron.requested("takeoff", altitude=40.0)
    heron.goes(10.0, 10.0, 40.0)
    assert heron.away(10.0, 10.0) < 3.0
    heron.requested("transition", to="forward")
    heron.goes(200.0, 200.0, 50.0)
    assert heron.away(200.0, 200.0) < 110.0
    heron.requested("transition", to="hover")
    heron.requested("land")
    assert abs(heron.twin.get_pose()["position"]["z"]) < 0.5
