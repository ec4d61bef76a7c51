import os
import signal

import msgspec
import pytest

from fleet.cli.overview import edge_line
from fleet.model.geometry import Vector3
from fleet.model.state import EdgeState, RobotState

EDGE_FIELDS = set(EdgeState.__struct_fields__)
ROBOT_FIELDS = set(RobotState.__struct_fields__)


def test_without_an_edge_it_says_how_to_start_one(fleet, runtime):
    result = fleet("ps")
    assert (result.code, result.out) == (4, "")
    assert (
        result.err
        == "fleet: no edge is running here; start one with: fleet run fleet.yaml (or: fleet demo)\n"
    )


def test_without_the_edge_of_the_file_it_says_that(fleet, runtime):
    result = fleet("ps", "-f", "fleet.yaml")
    assert result.code == 4
    assert "edge yard-1: edge 'yard-1' does not run here" in result.err


def test_a_broken_file_is_reported_as_such(fleet, place, runtime):
    (place / "fleet.yaml").write_text("edge: {id: 5")
    assert fleet("ps", "-f", "fleet.yaml").code == 3


def test_robots_and_edges_of_all_edges_are_shown(fleet, play_edge):
    play_edge("yard-1", robots={"rex": {"health": "ok", "battery": 81.4, "mode": "GUIDED", "armed": True}})
    play_edge("barn", robots={"kestrel": {"cause": "no heartbeat"}})
    result = fleet("ps")
    assert result.code == 0
    rows = result.out.splitlines()
    assert rows[0] == "2 robots on 2 edges: 1 offline, 1 ok; all real"
    headings = ["ROBOT", "EDGE", "KIND", "SIM", "HEALTH", "MODE", "BAT%", "POSITION", "M/S", "AGE", "DOING"]
    assert rows[1].split() == [*headings, "LAST", "COMMAND"]
    assert rows[2].split() == ["kestrel", "barn", "toy", "real", "offline", *"-------"]
    assert rows[3].split() == ["rex", "yard-1", "toy", "real", "ok", "GUIDED", "armed", "81", *"-----"]
    assert "kestrel: no heartbeat" in rows
    assert any(row.startswith("edge barn: ok") for row in rows)
    assert any(row.startswith("edge yard-1: ok") for row in rows)


def test_robots_of_one_name_on_two_edges_are_distinguished(fleet, play_edge):
    play_edge("demo", robots={"drone-1": {"health": "ok"}})
    play_edge("demo-2", robots={"drone-1": {"cause": "no heartbeat"}, "dog-1": {"health": "ok"}})
    rows = fleet("ps").out.splitlines()
    assert {row.split()[0] for row in rows[2:5]} == {"demo/drone-1", "demo-2/drone-1", "dog-1"}
    assert "demo-2/drone-1: no heartbeat" in rows


def test_where_robots_are_in_the_frame_of_the_site_is_shown_once_one_is_placed(fleet, play_edge):
    rex = {"health": "ok", "site": Vector3(1.0, -2.04, 0.0), "separation": "unknown to kestrel"}
    kestrel = {"position": Vector3(3.0), "speed": 1.26, "age": 90.0, "simulated": True}
    play_edge("yard-1", robots={"rex": rex, "kestrel": kestrel})
    rows = fleet("ps").out.splitlines()
    assert rows[1].split()[:7] == ["ROBOT", "KIND", "SIM", "HEALTH", "MODE", "BAT%", "SITE"]
    assert rows[2].split()[2:6] == ["sim", "offline", "-", "-"]
    assert "3.0 0.0 0.0 own  1.3  2 min  -" in rows[2]
    assert rows[3].split()[3:] == ["ok", "-", "-", "1.0", "-2.0", "0.0", *"----"]
    assert "rex: separation unknown to kestrel" in rows


def test_json_has_every_field_of_everything(fleet, play_edge):
    play_edge("yard-1", robots={"rex": {"health": "offline", "position": Vector3(1.0, 2.0, 3.0)}})
    result = fleet("ps", "--json")
    (edge,) = result.json["edges"]
    (robot,) = result.json["robots"]
    assert set(edge) == EDGE_FIELDS
    assert set(robot) == ROBOT_FIELDS
    assert (edge["health"], robot["health"], robot["armed"]) == ("ok", "offline", None)
    assert robot["position"] == {"x": 1.0, "y": 2.0, "z": 3.0}


def test_a_sender_whose_clock_is_off_or_whose_way_is_slow_is_reported(fleet, play_edge):
    play_edge("yard-1", robots={"rex": {"senders": {"cloud/anna": 1.9, "bus/": 0.004}}})
    assert fleet("ps").out.count("behind") == 1
    assert (
        "rex: the clock of cloud/anna is 1.90 s behind, or the network delays it as much" in fleet("ps").out
    )
    assert fleet("ps", "--json").json["robots"][0]["senders"] == {"cloud/anna": 1.9, "bus/": 0.004}


def test_what_a_robot_says_cannot_steer_the_terminal(fleet, play_edge):
    play_edge("yard-1", robots={"rex": {"cause": "\x1b[2Jgone\r\nedge", "mode": "\x1b]0;x\x07"}})
    result = fleet("ps")
    assert not {"\x1b", "\r", "\x07"} & set(result.out + result.err)
    assert "rex: \\x1b[2Jgone\\r\\nedge" in result.out


def test_the_newest_of_several_words_about_a_robot_counts(fleet, play_edge):
    edge = play_edge("yard-1", robots={"rex": {"health": "ok", "stamp": 2.0}})
    edge.add_robot("rex", health="offline", stamp=1.0)
    assert [robot["health"] for robot in fleet("ps", "--json").json["robots"]] == ["ok"]


def test_an_answer_that_cannot_be_read_hides_no_other(fleet, play_edge, caplog):
    edge = play_edge("yard-1", robots={"rex": {"health": "ok"}})
    edge.answer_garbage("ghost")
    result = fleet("ps", "--json")
    assert [robot["name"] for robot in result.json["robots"]] == ["rex"]
    assert "fleet/yard-1/robots/ghost/state cannot be read" in caplog.text


def test_edges_that_are_linked_are_shown_once(fleet, play_edge, free_port):
    play_edge("yard-1", robots={"rex": {"health": "ok"}}, listen=(f"tcp/127.0.0.1:{free_port}",))
    play_edge("barn", connect=(f"tcp/127.0.0.1:{free_port}",)).sees("yard-1")
    result = fleet("ps", "--json")
    assert [edge["edge"] for edge in result.json["edges"]] == ["barn", "yard-1"]
    assert len(result.json["robots"]) == 1


def test_an_edge_with_a_password_is_not_reached_without_its_file(fleet, play_edge):
    play_edge("yard-1", user="anna", password="secret")
    result = fleet("ps")
    assert result.code == 4
    assert "edge yard-1: cannot join the bus" in result.err
    assert "if it has a password, give its file: -f fleet.yaml" in result.err


def test_an_edge_with_a_password_is_reached_with_its_file(fleet, place, play_edge):
    play_edge("yard-1", user="anna", password="secret")
    text = (place / "fleet.yaml").read_text()
    (place / "fleet.yaml").write_text(f"bus: {{user: anna, password: secret}}\n{text}")
    result = fleet("ps", "--json", "-f", "fleet.yaml")
    assert [edge["edge"] for edge in result.json["edges"]] == ["yard-1"]


def test_a_frozen_edge_is_reported_and_hides_no_other(fleet, play_edge, spawn_edge):
    play_edge("yard-1", robots={"rex": {"health": "ok"}})
    os.kill(spawn_edge("barn").pid, signal.SIGSTOP)
    result = fleet("ps", "--json")
    assert [robot["name"] for robot in result.json["robots"]] == ["rex"]
    assert "edge barn: cannot join the bus" in result.err
    assert result.code == 0


def test_an_edge_that_answers_nothing_is_reported(fleet, spawn_edge):
    spawn_edge("barn")
    result = fleet("ps")
    assert result.code == 4
    assert "does not answer" in result.err


def test_an_edge_that_answers_nothing_is_reported_beside_one_that_does(fleet, play_edge, spawn_edge):
    play_edge("yard-1", robots={"rex": {"health": "ok"}})
    spawn_edge("barn")
    result = fleet("ps")
    assert (result.code, "rex" in result.out) == (0, True)
    assert result.err == "edge barn runs but does not answer: its event loop hangs\n"


@pytest.mark.parametrize("arguments", [("--json",), ()])
def test_an_edge_without_robots_is_shown(fleet, play_edge, arguments):
    play_edge("yard-1")
    result = fleet("ps", *arguments)
    assert result.code == 0
    assert "yard-1" in result.out


def test_an_edge_says_how_far_the_cloud_is_and_what_waits_was_dropped_or_refused():
    edge = EdgeState("yard-1", "0", 1.0, 5.0, cloud="connected")
    assert edge_line(edge).endswith("cloud connected; up 5 s")
    busy = msgspec.structs.replace(
        edge, round_trip=0.0421, waiting=2, queued=4, spooled=3, dropped=4, refused=5
    )
    said = "cloud connected (42 ms away, 3 messages not sent yet, 4 dropped, 5 refused); up"
    assert said in edge_line(busy)


def test_messages_that_nobody_subscribes_to_are_distinguished_from_those_that_wait_for_the_cloud():
    edge = EdgeState("yard-1", "0", 1.0, 5.0, cloud="connected", queued=3, spooled=3, unheard=2)
    assert "(1 message not sent yet, 2 messages kept until they have a subscriber)" in edge_line(edge)


def test_states_that_only_wait_for_their_turn_are_no_backlog():
    edge = EdgeState("yard-1", "0", 1.0, 5.0, cloud="connected", waiting=22, queued=22)
    assert edge_line(edge).endswith("cloud connected; up 5 s")


def forty():
    return {f"drone-{n}": {"health": "offline", "cause": f"no heartbeat for {n} s"} for n in range(1, 41)}


@pytest.mark.parametrize(("columns", "lines"), [(80, 24), (120, 40)])
def test_on_a_terminal_forty_robots_fit_and_the_rest_is_counted(terminal, play_edge, columns, lines):
    play_edge("yard-1", robots=forty())
    shown = terminal("ps", "--no-color", columns=columns, lines=lines)
    assert shown.ended() == 0
    rows = shown.text.splitlines()
    assert len(rows) < lines
    assert max(map(len, rows)) <= columns
    assert "more (" in shown.text


def test_all_robots_are_shown_on_a_terminal_when_asked(terminal, play_edge):
    play_edge("yard-1", robots=forty())
    shown = terminal("ps", "--all", "--no-color")
    assert shown.ended() == 0
    assert all(f"\ndrone-{n} " in shown.text for n in range(1, 41))


def test_watching_draws_in_place_and_ends_with_ctrl_c_without_a_word(terminal, play_edge):
    play_edge("yard-1", robots={"rex": {"health": "ok"}})
    shown = terminal("ps", "--watch")
    home = "\x1b[H"
    shown.reads(home)
    shown.text = shown.text.partition(home)[2]
    shown.reads(home)
    shown.interrupt()
    assert shown.ended() == 130
    assert "Traceback" not in shown.text


def test_watching_goes_on_when_the_edge_goes_and_another_comes(terminal, play_edge):
    first = play_edge("yard-1", robots={"rex": {"health": "ok"}})
    shown = terminal("ps", "--watch", "--json")
    shown.reads('"name": "rex"')
    first.bus.close()
    shown.reads("no edge is running here")
    play_edge("barn", robots={"kestrel": {"health": "ok"}})
    shown.reads('"name": "kestrel"')
