"""What a user sees when something is missing or wrong: one clear line, and whatever else can run, runs."""

import json
import socket

import pytest

from tests.tools.ports import free_ports

TWINS = [f"6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b{number:02d}" for number in range(10, 20)]
GOOD = {"name": "good", "twin": TWINS[0], "adapter": "mavlink", "link": "sim:px4"}


class Misfortune:
    """A running edge; one robot is well, others have no autopilot, no port, no adapter."""

    def __init__(self, start, folder, *links):
        self.start, self.file = start, folder / "fleet.yaml"
        self.running = start("run", "--json", str(self.file), code=7)
        self.absent, self.taken = links


@pytest.fixture(scope="module")
def misfortune(shared_fleet, shared_folder):
    """Run it for the tests of robots."""
    (port,) = free_ports(1, socket.SOCK_DGRAM)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        absent, taken = (f"udpin:127.0.0.1:{each}" for each in (port, other.getsockname()[1]))
        (shared_folder / "plugins").mkdir()
        (shared_folder / "plugins" / "broken.py").write_text("import a_library_that_is_not_there\n")
        robots = [
            GOOD,
            {"name": "odd", "twin": TWINS[3], "adapter": "broken"},
            {"name": "lost", "twin": TWINS[1], "adapter": "mavlink", "link": absent},
            {"name": "blocked", "twin": TWINS[2], "adapter": "mavlink", "link": taken},
        ]
        write(shared_folder, plugins=["plugins"], robots=robots)
        misfortune = Misfortune(shared_fleet, shared_folder, absent, taken)
        misfortune.running.robot("good", "is well", is_well)
        yield misfortune


def write(folder, **sections):
    """Write a fleet file of these sections."""
    (folder / "fleet.yaml").write_text(json.dumps({"edge": {"id": "yard"}, **sections}))


def is_well(state):
    return state["health"] == "ok"


def test_an_absent_broker_is_reported_and_the_robots_fly_on_the_bus(fleet, tmp_path, free_port):
    cloud = {"host": "127.0.0.1", "port": free_port, "tls": False}
    write(tmp_path, cloud=cloud, robots=[GOOD])
    running = fleet("run", "--json", folder=tmp_path)
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


def test_a_broken_plugin_is_left_out_with_its_reason(misfortune):
    assert "a_library_that_is_not_there" in misfortune.running.line(r"left out: .*").group()
    misfortune.running.robot("good", "is well", is_well)


def test_a_second_edge_of_the_same_name_is_refused_in_one_line(misfortune):
    second = misfortune.start("run", str(misfortune.file), code=1)
    second.line("runs already")
    second.process.wait()
    assert second.end() == 1
    assert "Traceback" not in "".join(second.errors)
