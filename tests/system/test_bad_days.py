"""What a user sees when something is missing or wrong: one clear line, and whatever else can run, runs."""

import json
import socket

import pytest

from tests.tools.ports import free_ports

TWINS = [f"6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b{number:02d}" for number in range(10, 20)]
GOOD = {"name": "good", "twin": TWINS[0], "adapter": "mavlink", "link": "sim:px4"}


class Misfortune:
    """A running edge; one robot is well, another has no autopilot, a third no port."""

    def __init__(self, running, folder, *links):
        self.running, self.file = running, folder / "fleet.yaml"
        self.absent, self.taken = links


@pytest.fixture(scope="module")
def misfortune(shared_fleet, shared_folder):
    """Run it for the tests of robots."""
    (port,) = free_ports(1, socket.SOCK_DGRAM)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        absent, taken = (f"udpin:127.0.0.1:{each}" for each in (port, other.getsockname()[1]))
        robots = [
            GOOD,
            {"name": "lost", "twin": TWINS[1], "adapter": "mavlink", "link": absent},
            {"name": "blocked", "twin": TWINS[2], "adapter": "mavlink", "link": taken},
        ]
        running = run(shared_fleet, shared_folder, edge={"id": "yard"}, robots=robots)
        running.robot("good", "is well", is_well)
        yield Misfortune(running, shared_folder, absent, taken)


def run(fleet, folder, **sections):
    """Run a fleet with these sections of its file."""
    (folder / "fleet.yaml").write_text(json.dumps(sections))
    return fleet("run", "--json", folder=folder)


def is_well(state):
    return state["health"] == "ok"


def test_an_absent_broker_is_reported_and_the_robots_fly_on_the_bus(fleet, tmp_path, free_port):
    cloud = {"host": "127.0.0.1", "port": free_port, "tls": False}
    running = run(fleet, tmp_path, edge={"id": "yard"}, cloud=cloud, robots=[GOOD])
    running.robot("good", "is well", is_well)
    assert "127.0.0.1" in running.line(r"WARNING .*cloud disconnected: .*").group()
    edge = json.loads(running.call("ps", "--json").stdout)["edges"][0]
    assert (edge["health"], edge["cloud"]) == ("degraded", "disconnected")
    assert running.call("send", "good", "battery_check").returncode == 0


def test_an_absent_autopilot_is_offline_with_the_place_where_it_was_expected(misfortune):
    running = misfortune.running
    state = running.robot("lost", "is missed", lambda state: "no heartbeat" in state["cause"])
    assert misfortune.absent in state["cause"]
    answer = running.call("send", "lost", "takeoff")
    assert answer.returncode == 5
    assert "no heartbeat" in answer.stdout


def test_a_port_that_is_taken_is_a_fault_of_that_robot_alone(misfortune):
    state = misfortune.running.robot("blocked", "is faulty", lambda state: state["health"] == "fault")
    assert misfortune.taken in state["cause"]
    misfortune.running.robot("good", "is well", is_well)


def test_a_broken_plugin_is_left_out_with_its_reason(tmp_path, fleet):
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "broken.py").write_text("import a_library_that_is_not_there\n")
    robot = {"name": "odd", "twin": TWINS[1], "adapter": "broken"}
    file = {"edge": {"id": "yard"}, "plugins": ["plugins"], "robots": [GOOD, robot]}
    (tmp_path / "fleet.yaml").write_text(json.dumps(file))
    running = fleet("run", "--json", folder=tmp_path, code=7)
    assert "a_library_that_is_not_there" in running.line(r"left out: .*").group()
    running.robot("good", "is well", is_well)


def test_a_second_edge_of_the_same_name_is_refused_in_one_line(misfortune):
    second = misfortune.running.call("run", str(misfortune.file))
    assert second.returncode == 1
    assert "runs already" in second.stderr
    assert "Traceback" not in second.stderr
