import contextlib
import json
import signal
import subprocess
import sys
import urllib.error

import pytest

from fleet.bus import keys
from fleet.client.fleet_watch import FleetWatch
from fleet.clock import SystemClock
from fleet.model.summary import Trouble
from tests.tools.scraping import scraped
from tests.tools.waiting import wait_until

HUB = Trouble("offline", "No such device; is it plugged in?", 1.0, 3, "ugv", "serial:/dev/ttyUSB3", ("a",))
CHAIN = "3 ugv robots offline <- serial:/dev/ttyUSB3: No such device; is it plugged in? <- edge-b"


@pytest.fixture(autouse=True)
def _own_state(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def watch(runtime):
    with FleetWatch(None, SystemClock()) as watch:
        yield watch


def reaches(edges):
    now = SystemClock.time()
    return {edge.edge: edge.reach(now).value for edge in edges}


# -- once ------------------------------------------------------------------------------------------------


def test_the_cause_is_shown_with_the_way_from_robot_to_edge_and_the_next_thing_to_do(fleet, play_edge):
    play_edge("edge-a").publish_summary()
    play_edge("edge-b").publish_summary(HUB, robots={"ok": 17, "offline": 3})
    result = fleet("ps", "--site")
    rows = result.out.splitlines()
    assert rows[0] == "2 edges: 2 up; 40 robots: 3 offline, 37 ok"
    assert rows[1].endswith(CHAIN)
    assert rows[2].strip() == "-> check the cable, the hub and its power: serial:/dev/ttyUSB3"
    assert [row.split()[:2] for row in rows[4:]] == [["edge-a", "up"], ["edge-b", "up"]]
    assert (result.code, result.err) == (0, "")


def test_an_edge_that_is_gone_is_shown_by_the_next_command_until_it_is_forgotten(fleet, play_edge):
    play_edge("edge-a").publish_summary()
    gone = play_edge("edge-b").publish_summary()
    assert "2 edges: 2 up" in fleet("ps", "--fleet").out
    gone.bus.close()
    result = fleet("ps", "--fleet")
    assert "2 edges: 1 gone, 1 up; 40 robots: 20 unknown, 20 ok" in result.out
    assert "1 edge gone <- not on the bus; its robots send nothing <- edge-b" in result.out
    assert "power, network" in result.out
    assert fleet("top", "--forget", "edge-b").out.startswith("edge-b is forgotten")
    assert "1 edge: 1 up" in fleet("ps", "--fleet").out
    assert fleet("top", "--forget", "edge-b").code == 5


def test_an_edge_that_sends_no_summary_is_silent(fleet, play_edge):
    play_edge("edge-a").publish_summary()
    play_edge("older")
    result = fleet("ps", "--site")
    assert "2 edges: 1 silent, 1 up" in result.out
    assert "1 edge silent <- on the bus, but it sends no summary <- older" in result.out


def test_json_has_every_edge_with_its_summary(fleet, play_edge):
    play_edge("edge-b").publish_summary(HUB, robots={"ok": 17, "offline": 3})
    found = fleet("ps", "--fleet", "--json").json
    assert found["edges"] == {"up": 1}
    assert found["robots"] == {"ok": 17, "offline": 3}
    assert found["problems"] == []
    (row,) = found["rows"]
    assert (row["robots"], row["edges"], row["link"]) == (3, ["edge-b"], "serial:/dev/ttyUSB3")
    (edge,) = found["each"]
    assert (edge["edge"], edge["reach"], edge["summary"]["version"]) == ("edge-b", "up", "1.0")


def test_the_site_is_that_of_the_edges_here_and_the_fleet_is_all(fleet, play_edge, free_port):
    near = play_edge("near", listen=(f"tcp/127.0.0.1:{free_port}",)).publish_summary(site="north")
    place = play_edge("far", connect=(f"tcp/127.0.0.1:{free_port}",)).publish_summary(site="south")
    place.sees("near")
    near.sees("far")
    assert {row["edge"] for row in fleet("ps", "--fleet", "--json").json["each"]} == {"near", "far"}


def test_without_an_edge_it_says_how_to_start_one(fleet, runtime):
    result = fleet("ps", "--site")
    assert (result.code, result.out) == (4, "")
    assert "no edge is running here" in result.err


def test_robots_are_watched_by_ps_and_sites_by_top(fleet, runtime):
    assert fleet("ps", "--site", "--watch").code == 2


# -- live ------------------------------------------------------------------------------------------------


def test_what_an_edge_publishes_is_seen_at_once_and_garbage_is_reported(watch, play_edge):
    edge = play_edge("edge-b").publish_summary()
    assert reaches(watch.update()) == {"edge-b": "up"}
    edge.publish_summary(HUB, publish=True)
    wait_until("the trouble is seen", lambda: watch.update()[0].summary.troubles == (HUB,))
    edge.bus.control.put(keys.summary("edge-b"), b"garbage")
    wait_until("the garbage is told", lambda: watch.update() and watch.problems)
    assert watch.problems[0].startswith("edge edge-b: a summary that cannot be read")
    assert watch.update()[0].summary.troubles == (HUB,), "the last good one counts"


def test_edges_that_come_and_go_are_followed(watch, play_edge):
    play_edge("edge-a").publish_summary()
    assert reaches(watch.update()) == {"edge-a": "up"}
    going = play_edge("edge-b").publish_summary()
    wait_until("it has come", lambda: reaches(watch.update()) == {"edge-a": "up", "edge-b": "up"})
    going.bus.close()
    wait_until("it is gone", lambda: reaches(watch.update()) == {"edge-a": "up", "edge-b": "gone"})
    play_edge("edge-b").publish_summary()
    wait_until("it is back", lambda: reaches(watch.update()) == {"edge-a": "up", "edge-b": "up"})


def test_an_edge_beyond_another_is_gone_when_its_token_ends(watch, play_edge, free_port):
    near = play_edge("near", listen=(f"tcp/127.0.0.1:{free_port}",)).publish_summary()
    far = play_edge("far", connect=(f"tcp/127.0.0.1:{free_port}",)).publish_summary()
    near.sees("far")
    wait_until("both are there", lambda: reaches(watch.update()) == {"near": "up", "far": "up"})
    far.bus.close()
    wait_until("one is gone", lambda: reaches(watch.update()) == {"near": "up", "far": "gone"})


def test_who_is_cut_off_says_so_and_calls_no_edge_gone(fleet, place, play_edge, free_port):
    router = play_edge("hub", listen=(f"tcp/127.0.0.1:{free_port}",)).publish_summary()
    connect = f'{{connect: ["tcp/127.0.0.1:{free_port}"], insecure: local}}'
    (place / "view.yaml").write_text(f"edge: {{id: view}}\nbus: {connect}\n")
    with FleetWatch("view.yaml", SystemClock()) as watch:
        assert reaches(watch.update()) == {"hub": "up"}
        router.bus.close()
        wait_until("it is cut off", lambda: reaches(watch.update()) == {"hub": "unseen"})
        assert "cannot join the bus" in watch.problems[0]


def test_a_terminal_shows_it_live(terminal, play_edge, runtime):
    edge = play_edge("edge-b").publish_summary()
    shown = terminal("top", "--no-color", columns=100, lines=20, FLEET_RUNTIME_DIR=str(runtime))
    shown.reads("1 edge: 1 up; 20 robots: 20 ok")
    edge.publish_summary(HUB, robots={"ok": 17, "offline": 3}, publish=True)
    shown.reads("3 ugv robots offline <- serial:/dev/ttyUSB3")
    shown.interrupt()
    assert shown.ended() == 130


# -- metrics ---------------------------------------------------------------------------------------------


def test_top_serves_them_while_it_runs(terminal, play_edge, runtime, free_port):
    play_edge("edge-b").publish_summary()
    shown = terminal("top", "--json", "--metrics", str(free_port), FLEET_RUNTIME_DIR=str(runtime))
    shown.reads('"problems": []}\n')
    assert json.loads(shown.text.splitlines()[0])["edges"] == {"up": 1}
    assert scraped(free_port)["fleet_edge_up", "edge-b", "up"] == 1
    shown.interrupt()
    shown.ended()


def test_without_a_terminal_it_only_serves_them(place, play_edge, runtime, free_port):
    play_edge("edge-b").publish_summary()
    command = [sys.executable, "-m", "fleet", "top", "--metrics", str(free_port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        try:
            wait_until("it serves", lambda: is_served(free_port))
        finally:
            running.send_signal(signal.SIGINT)
            said, _ = running.communicate(timeout=60)
    assert said == ""


def is_served(port):
    with contextlib.suppress(urllib.error.URLError):
        return scraped(port).get(("fleet_edge_up", "edge-b", "up")) == 1
    return False
