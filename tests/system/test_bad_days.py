"""What a user sees when something is missing or wrong: one clear line, and whatever else can run, runs."""

import json
import socket

import pytest

TWINS = [f"6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b{number:02d}" for number in range(10, 20)]
GOOD = {"name": "good", "twin": TWINS[0], "adapter": "mavlink", "link": "sim:px4"}


@pytest.fixture
def run(fleet, tmp_path):
    """Run a fleet of the good robot and others; gives the process."""

    def start(*robots, **sections):
        file = {"edge": {"id": "yard"}, **sections, "robots": [GOOD, *robots]}
        (tmp_path / "fleet.yaml").write_text(json.dumps(file))
        return fleet("run", "--json", folder=tmp_path)

    return start


def is_well(state):
    return state["health"] == "ok"


def test_an_absent_broker_is_reported_and_the_robots_fly_on_the_bus(run, free_port):
    running = run(cloud={"host": "127.0.0.1", "port": free_port, "tls": False})
    running.robot("good", "is well", is_well)
    assert "127.0.0.1" in running.line(r"WARNING .*cloud disconnected: .*").group()
    edge = json.loads(running.call("ps", "--json").stdout)["edges"][0]
    assert (edge["health"], edge["cloud"]) == ("degraded", "disconnected")
    assert running.call("send", "good", "battery_check").returncode == 0


def test_an_absent_autopilot_is_offline_with_the_place_where_it_was_expected(run, free_udp_port):
    link = f"udpin:127.0.0.1:{free_udp_port}"
    running = run({"name": "lost", "twin": TWINS[1], "adapter": "mavlink", "link": link})
    running.robot("good", "is well", is_well)
    state = running.robot("lost", "is missed", lambda state: "no heartbeat" in state["cause"])
    assert link in state["cause"]
    answer = running.call("send", "lost", "takeoff")
    assert answer.returncode == 5
    assert "no heartbeat" in answer.stdout


def test_a_port_that_is_taken_is_a_fault_of_that_robot_alone(run):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        link = f"udpin:127.0.0.1:{other.getsockname()[1]}"
        running = run({"name": "blocked", "twin": TWINS[1], "adapter": "mavlink", "link": link})
        running.robot("good", "is well", is_well)
        state = running.robot("blocked", "is faulty", lambda state: state["health"] == "fault")
        assert link in state["cause"]


def test_a_broken_plugin_is_left_out_with_its_reason(run, tmp_path, fleet):
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "broken.py").write_text("import a_library_that_is_not_there\n")
    robot = {"name": "odd", "twin": TWINS[1], "adapter": "broken"}
    file = {"edge": {"id": "yard"}, "plugins": ["plugins"], "robots": [GOOD, robot]}
    (tmp_path / "fleet.yaml").write_text(json.dumps(file))
    running = fleet("run", "--json", folder=tmp_path, code=7)
    assert "a_library_that_is_not_there" in running.line(r"left out: .*").group()
    running.robot("good", "is well", is_well)


def test_a_second_edge_of_the_same_name_is_refused_in_one_line(run, tmp_path):
    running = run()
    running.robot("good", "is well", is_well)
    second = running.call("run", str(tmp_path / "fleet.yaml"))
    assert second.returncode == 1
    assert "runs already" in second.stderr
    assert "Traceback" not in second.stderr
