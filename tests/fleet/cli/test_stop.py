import json
import os
import signal
import subprocess
import sys
import threading

import pytest

from fleet.bus.settings import BusSettings, runtime_dirs
from fleet.cli.outline import EdgeOutline, outline
from fleet.cli.stop import _outcomes
from fleet.client.edges import decoded
from fleet.errors import BusError
from fleet.supervisor.protocol import StopAnswer
from tests.tools.waiting import DEADLINE


@pytest.fixture
def yard(play_edge):
    """Play an edge with three robots, two of them in a group."""
    robots = {name: {"health": "ok"} for name in ("rex", "beast", "kestrel")}
    return play_edge("yard-1", robots=robots, groups={"ground": ["rex", "beast"]})


def test_robots_are_stopped_and_how_they_are_released_is_shown(fleet, yard):
    result = fleet("stop", "rex")
    assert (result.code, result.out) == (0, "rex: stopped\n")
    assert result.err == "reached: edge yard-1\nreleased with: fleet release ROBOT\n"
    assert yard.stops == [["rex"]]


def test_a_group_is_stopped(fleet, yard):
    result = fleet("stop", "ground")
    assert (result.code, result.out) == (0, "beast: stopped\nrex: stopped\n")


def test_everything_is_stopped_on_every_edge(fleet, yard, play_edge):
    barn = play_edge("barn", robots={"mule": {}})
    result = fleet("stop", "--all", "--json")
    assert result.code == 0
    assert result.json == {
        "stopped": ["beast", "kestrel", "mule", "rex"],
        "missing": [],
        "edges": ["barn", "yard-1"],
        "problems": [],
        "kept": {},
        "failed": {},
    }
    assert yard.stops == barn.stops == [[]]


def test_who_was_not_stopped_is_reported(fleet, yard):
    result = fleet("stop", "rex", "kestral")
    assert (result.code, result.out) == (7, "rex: stopped\n")
    assert "kestral: NOT STOPPED" in result.err


def test_a_robot_of_another_edge_is_not_stopped_by_its_namesake(fleet, yard):
    result = fleet("stop", "yard-1/rex", "barn/rex")
    assert (result.code, result.out) == (7, "rex: stopped\n")
    assert "barn/rex: NOT STOPPED" in result.err


def test_a_name_that_is_no_text_holds_up_no_stop(fleet, yard):
    result = fleet("stop", "rex", "kestr\udce9l")
    assert (result.code, result.out) == (7, "rex: stopped\n")
    assert yard.stops == [["rex", "kestr?l"]]


def test_a_stop_that_nobody_took_is_no_success(fleet, yard):
    result = fleet("stop", "kestral")
    assert (result.code, result.out) == (5, "")
    assert "kestral: NOT STOPPED" in result.err


def test_a_robot_of_which_no_state_comes_was_not_seen_to_stop(fleet, yard, monkeypatch):
    monkeypatch.setattr("fleet.cli.stop.SEEN_WITHIN", 0.3)
    yard.go_silent()
    result = fleet("stop", "rex", "ghost")
    assert (result.code, result.out) == (
        5,
        "rex: NOT SEEN TO STOP: no state of it came after the stop\n",
    )
    assert "ghost: NOT STOPPED" in result.err
    assert "rex: NOT STOPPED" not in result.err
    assert yard.stops == [["rex", "ghost"]]


@pytest.mark.parametrize("known", [{}, {"last_command": "move_forward", "last_outcome": "done"}])
def test_a_state_from_before_the_stop_shows_no_stop(fleet, play_edge, monkeypatch, known):
    monkeypatch.setattr("fleet.cli.stop.SEEN_WITHIN", 0.3)
    yard = play_edge("yard-1", robots={"rex": known})
    yard.shows_stops = False
    result = fleet("stop", "--all", "--json")
    assert result.json["failed"] == {"rex": "no state of it came after the stop"}
    assert result.json["stopped"] == []


def test_an_edge_that_took_the_stop_from_its_supervisor_is_not_missing(fleet, yard, monkeypatch):
    def no_way_in(settings, _directory):
        raise BusError("its bus lets nobody in")

    answer = StopAnswer(edge="yard-1", names=("rex",))
    monkeypatch.setattr("fleet.cli.stop.join_control", no_way_in)
    monkeypatch.setattr("fleet.cli.stop.stop_all", lambda *_, **__: [answer])
    result = fleet("stop", "rex", "--json")
    assert result.json["missing"] == []
    assert result.json["edges"] == ["yard-1"]
    assert result.json["failed"] == {"rex": "no state of it came after the stop"}
    assert result.json["problems"] == ["edge yard-1: its bus lets nobody in"]


def test_the_help_says_what_an_emergency_stop_lets_through(fleet):
    help_text = " ".join(fleet("stop", "--help").out.split())
    assert "Aircraft: land, return_to_home" in help_text
    assert "Wheeled robots, dogs, boats and submarines: nothing that moves them" in help_text


def test_a_robot_whose_worker_hears_no_stop_is_reported_when_all_are_stopped(fleet, yard):
    yard.add_robot("mule", cause="worker mule: frozen")
    result = fleet("stop", "--all")
    assert result.code == 7
    assert "mule: NOT STOPPED" in result.err


def test_a_frozen_edge_does_not_keep_a_stop_from_the_others(fleet, yard, spawn_edge):
    os.kill(spawn_edge("barn").pid, signal.SIGSTOP)
    result = fleet("stop", "--all")
    assert result.code == 7
    assert result.out == "beast: stopped\nkestrel: stopped\nrex: stopped\n"
    assert "edge barn: cannot join the bus" in result.err


HANGS = "import time; time.sleep(600)"
BROKEN = {
    "no adapter": "edge: {id: yard-1}\nrobots: [{name: rex, adapter: nosuch, twin: 5}]\n",
    "no secret": "edge: {id: yard-1}\ncloud: {host: h, token: !secret gone}\nrobots: []\n",
    "no variable": "edge: {id: yard-1}\nbus: {scouting: ${GONE}}\n",
    "a section that is no YAML": "edge: {id: yard-1}\nrobots: [{name: rex,\nbus: {}\n",
    "the edge's own section": "edge: {id: yard-1\nrobots: []\n",
    "a key twice": "edge: {id: yard-1}\nedge: {id: yard-1}\n",
    "no UTF-8": "edge: {id: yard-1}\nrobots: \udcff\n",
    "plugins that hang": "edge: {id: yard-1}\nplugins: [hanging]\nrobots: [{name: rex, adapter: hang}]\n",
    "nothing": "",
    "no mapping": "- 1\n",
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_stop_needs_no_file_that_is_right(fleet, yard, place, what):
    (place / "hanging").mkdir()
    (place / "hanging" / "hang.py").write_text(HANGS)
    (place / "broken.yaml").write_bytes(BROKEN[what].encode(errors="surrogateescape"))
    result = fleet("stop", "--all", "-f", "broken.yaml")
    assert result.out == "beast: stopped\nkestrel: stopped\nrex: stopped\n"
    assert result.code == 0
    assert yard.stops
    assert set(map(str, yard.stops)) == {"[]"}


@pytest.mark.parametrize(
    ("tls", "mutual"), [({}, True), ({"mutual": True}, True), ({"mutual": False}, False), (None, False)]
)
def test_a_stop_shows_its_certificate_where_every_other_command_does(place, tls, mutual):
    files = {name: name for name in ("root_ca", "cert", "key")}
    given = {} if tls is None else {"tls": {**files, **tls}}
    file = place / "fleet.yaml"
    file.write_text(json.dumps({"edge": {"id": "yard-1"}, "bus": {"connect": ["tls/10.0.0.1:1"], **given}}))
    assert outline("fleet.yaml").settings.tls.mutual is mutual


def test_a_file_that_is_not_there_keeps_no_stop(fleet, yard):
    result = fleet("stop", "--all", "-f", "gone.yaml")
    assert (result.code, len(result.out.splitlines())) == (0, 3)
    assert "cannot read gone.yaml" in result.err


def test_the_edge_of_a_broken_file_is_stopped_wherever_it_is(fleet, play_edge, place, free_port, monkeypatch):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    far = play_edge("far", robots={"mule": {}}, listen=(endpoint,))
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(place))
    (place / "far.yaml").write_text(f"edge: {{id: far}}\nbus: {{connect: [{endpoint}]}}\nrobots: [oh no\n")
    result = fleet("stop", "mule", "-f", "far.yaml")
    assert (result.code, result.out) == (0, "mule: stopped\n")
    assert far.stops == [["mule"]]


def test_robots_are_seen_to_stand_also_where_the_file_is_named_otherwise_than_their_edge(
    fleet, play_edge, place, free_port, monkeypatch
):
    endpoint, looks = f"tcp/127.0.0.1:{free_port}", []
    far = play_edge("far", robots={"mule": {}}, listen=(endpoint,))
    far.shows_stops = False
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(place))

    def look(*given):
        looks.append(given)
        if len(looks) == 2:
            far._stands.add("mule")
        return _outcomes(*given)

    monkeypatch.setattr("fleet.cli.stop._outcomes", look)
    (place / "laptop.yaml").write_text(f"edge: {{id: laptop}}\nbus: {{connect: [{endpoint}]}}\n")
    result = fleet("stop", "mule", "-f", "laptop.yaml")
    assert (result.code, result.out) == (0, "mule: stopped\n")


def test_a_password_that_cannot_be_read_is_reported_with_its_edge(fleet, yard, play_edge, place):
    shut = play_edge("barn", robots={"mule": {}}, user="me", password="secret")
    (place / "barn.yaml").write_text("edge: {id: barn}\nbus: {user: me, password: !secret gone}\n")
    result = fleet("stop", "--all", "-f", "barn.yaml")
    assert result.code == 7
    assert len(result.out.splitlines()) == 3
    assert "edge barn: cannot join the bus" in result.err
    assert "bus.user and bus.password cannot both be read: tried without" in result.err
    (place / "barn.yaml").write_text("edge: {id: barn}\nbus: {user: me, password: secret}\nrobots: oh\n")
    assert fleet("stop", "--all", "-f", "barn.yaml").code == 0
    assert shut.stops == [[]]


def test_a_file_whose_edge_is_not_there_is_reported_and_the_others_are_stopped(fleet, yard, place):
    (place / "far.yaml").write_text("edge: {id: far}\n")
    result = fleet("stop", "--all", "-f", "far.yaml")
    assert (result.code, len(result.out.splitlines())) == (7, 3)
    assert "edge far: edge 'far' does not run here" in result.err
    assert "reached: edge yard-1" in result.err


def test_the_edges_here_are_stopped_before_the_file_is_opened(fleet, yard, place, monkeypatch):
    stopped = threading.Event()

    def note(answers, kind):
        found = list(decoded(answers, kind))
        stopped.set()
        return iter(found)

    def slow(_file):
        assert stopped.wait(DEADLINE), "the stop waited for the file"
        return EdgeOutline(BusSettings(""))

    monkeypatch.setattr("fleet.cli.outline.outline", slow)
    monkeypatch.setattr("fleet.cli.stop.decoded", note)
    assert fleet("stop", "--all", "-f", "fleet.yaml").code == 0
    assert yard.stops == [[]]


@pytest.mark.parametrize("module", ["fleet.cli.main", "fleet.cli.stop"])
def test_a_stop_waits_for_no_import_of_models_plugins_or_yaml(module):
    heavy = {
        "pydantic",
        "yaml",
        "rich",
        "asyncio",
        "fleet.plugins.registry",
        "fleet.config.load",
        "fleet.adapter",
    }
    script = f"import sys, {module}; print(*sorted({heavy} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout) == (0, "\n")


def test_the_sockets_of_our_edges_are_found_whatever_the_environment_was(tmp_path, monkeypatch):
    memory, login = tmp_path / "shm", tmp_path / "login"
    for place in (memory / f"fleet-{os.getuid()}", login / "fleet", memory / "fleet-x"):
        place.mkdir(parents=True)
    (memory / "fleet-link").symlink_to(memory)
    monkeypatch.setattr("fleet.bus.settings.MEMORY", memory)
    found = runtime_dirs({"XDG_RUNTIME_DIR": str(login)})
    assert {login / "fleet", memory / f"fleet-{os.getuid()}"} <= set(found)
    assert memory / "fleet-link" not in found
    assert runtime_dirs({"FLEET_RUNTIME_DIR": "/only"}) == [place.__class__("/only")]


def test_a_robot_that_was_not_seen_to_stop_is_reported_in_its_own_words(fleet, play_edge):
    refused = {"last_command": "emergency_stop", "last_outcome": "error: HOLD was refused: FAILED"}
    play_edge("yard-1", robots={"rover": refused, "rex": {}})
    result = fleet("stop", "--all")
    assert (result.code, result.out) == (
        7,
        "rex: stopped\nrover: NOT SEEN TO STOP: error: HOLD was refused: FAILED\n",
    )


def test_a_stop_that_stays_under_way_is_reported_as_not_seen(fleet, play_edge, monkeypatch):
    monkeypatch.setattr("fleet.cli.stop.SEEN_WITHIN", 0.3)
    play_edge("yard-1", robots={"rover": {"last_command": "emergency_stop", "last_outcome": "under way"}})
    result = fleet("stop", "rover")
    assert (result.code, result.out) == (5, "rover: NOT SEEN TO STOP: nothing was seen within 0.3 s\n")
    assert "the stop is set; not seen to stand yet: rover" in result.err
