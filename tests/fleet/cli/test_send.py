import json

import pytest

from fleet.client.edges import Edges
from fleet.model.command import Reply, ReplyStatus

ACCEPTED = Reply("takeoff", ReplyStatus.ACCEPTED)
DONE = Reply("takeoff", ReplyStatus.ACCEPTED, done=True)
DENIED = Reply("takeoff", ReplyStatus.DENIED, "no GPS", "wait for a fix", device_result="MAV_RESULT_DENIED")
LATE = Reply("takeoff", ReplyStatus.TIMEOUT, "the robot is silent")


@pytest.fixture
def yard(play_edge):
    """Play an edge with three robots, two of them in a group."""
    robots = {name: {"health": "ok"} for name in ("rex", "beast", "kestrel")}
    return play_edge("yard-1", robots=robots, groups={"ground": ["rex", "beast"]})


def test_a_command_that_was_taken_is_reported(fleet, yard):
    requested = yard.answers("rex", ACCEPTED)
    result = fleet("send", "rex", "takeoff", "altitude=5", "name=a b", 'list=[1, "x"]')
    assert (result.code, result.out, result.err) == (0, "rex: takeoff accepted\n", "")
    message = json.loads(requested[0].payload)
    assert (message["command"], message["data"]) == (
        "takeoff",
        {"altitude": 5, "name": "a b", "list": [1, "x"]},
    )
    assert message["timestamp"] > 1.7e9
    assert requested[0].parameters == {"kind": "command", "wait": "0"}


@pytest.mark.parametrize(
    ("arguments", "kind"), [(("send", "rex", "takeoff"), "command"), (("goto", "rex", "1", "2"), "navigate")]
)
def test_a_command_is_stamped_when_it_is_sent_and_not_when_it_was_typed(
    fleet, yard, monkeypatch, arguments, kind
):
    named = Edges.named

    def slow(*given):
        found = named(*given)
        now.append(now[-1] + 33.0)  # a slow computer
        return found

    now = [1_800_000_000.0]
    monkeypatch.setattr(Edges, "named", slow)
    monkeypatch.setattr("time.time", lambda: now[-1])
    requested = yard.answers("rex", ACCEPTED)
    fleet(*arguments)
    assert requested[0].parameters["kind"] == kind
    assert json.loads(requested[0].payload)["timestamp"] == 1_800_000_033.0


def test_the_name_of_a_refused_command_is_written_once(fleet, yard):
    yard.answers("rex", Reply("blade_on", ReplyStatus.DENIED, "blade_on: speed must be 1500 to 3200 rpm"))
    result = fleet("send", "rex", "blade_on", "speed=1")
    assert result.out == "rex: blade_on denied: speed must be 1500 to 3200 rpm\n"


def test_whoever_waits_hears_the_end(fleet, yard):
    requested = yard.answers("rex", ACCEPTED, DONE)
    result = fleet("send", "rex", "takeoff", "--wait")
    assert (result.code, result.out) == (0, "rex: takeoff accepted\nrex: takeoff done\n")
    assert requested[0].parameters["wait"] == "1"


def test_what_was_asked_for_is_shown(fleet, yard):
    yard.answers("rex", Reply("look", ReplyStatus.ACCEPTED, done=True, data={"height": 3}))
    result = fleet("send", "rex", "look", "--wait")
    assert (result.code, result.out) == (0, 'rex: look done\n{"height": 3}\n')


def test_a_refusal_is_reported_with_what_to_do(fleet, yard):
    yard.answers("rex", DENIED)
    result = fleet("send", "rex", "takeoff")
    assert (result.code, result.out) == (5, "rex: takeoff denied: no GPS (wait for a fix)\n")


def test_a_command_that_fails_after_it_was_taken_is_a_refusal(fleet, yard):
    yard.answers("rex", ACCEPTED, Reply("takeoff", ReplyStatus.DENIED, "motor 3", done=False))
    result = fleet("send", "rex", "takeoff", "--wait")
    assert (result.code, result.out.splitlines()[-1]) == (5, "rex: takeoff failed: motor 3")


def test_a_robot_that_is_silent_is_reported_once(fleet, yard):
    yard.answers("rex", LATE)
    result = fleet("send", "rex", "takeoff")
    assert (result.code, result.out, result.err) == (6, "rex: takeoff timeout: the robot is silent\n", "")


def test_a_command_without_any_answer_has_timed_out(fleet, yard):
    yard.answers("rex")
    result = fleet("send", "rex", "takeoff")
    assert (result.code, result.out) == (6, "")
    assert result.err == "rex: takeoff timeout: no answer within 15 s\n"


def test_a_command_whose_end_is_not_seen_has_timed_out(fleet, yard):
    yard.answers("rex", ACCEPTED)
    result = fleet("send", "rex", "takeoff", "--wait", "--timeout", "30", "--json")
    assert result.code == 6
    (answer,) = result.json["answers"]
    assert (answer["status"], answer["done"]) == ("timeout", None)
    assert result.err == "rex: takeoff timeout: taken, but not seen to be done within 30 s\n"


def test_json_has_every_field_of_every_answer(fleet, yard):
    yard.answers("rex", DENIED)
    result = fleet("send", "rex", "takeoff", "--json")
    assert result.json == {
        "answers": [
            {
                "robot": "rex",
                "command": "takeoff",
                "status": "denied",
                "reason": "no GPS",
                "hint": "wait for a fix",
                "device_result": "MAV_RESULT_DENIED",
                "messages": [],
                "done": None,
                "data": None,
            }
        ]
    }


def test_what_a_robot_answers_cannot_steer_the_terminal(fleet, yard):
    yard.answers("rex", Reply("\x1b[2J", ReplyStatus.REJECTED, "\x1b]0;\x07", "\r"))
    result = fleet("send", "rex", "takeoff")
    assert not {"\x1b", "\r", "\x07"} & set(result.out + result.err)


def test_an_unknown_robot_is_reported_with_the_nearest(fleet, yard):
    result = fleet("send", "kestral", "land")
    assert (result.code, result.err) == (5, "fleet: there is no robot 'kestral' (did you mean 'kestrel'?)\n")


def test_an_unknown_robot_that_resembles_none_is_reported_with_all(fleet, yard):
    result = fleet("send", "zzz", "land")
    assert result.err == "fleet: there is no robot 'zzz' (there are: beast, kestrel, rex)\n"


def test_all_of_a_group_are_asked_at_once(fleet, yard):
    """Each robot answers only when both were asked."""
    requested = yard.answers_together({"rex": ACCEPTED, "beast": ACCEPTED})
    result = fleet("send", "ground", "takeoff")
    assert (result.code, len(requested)) == (0, 2)
    assert sorted(result.out.splitlines()) == ["beast: takeoff accepted", "rex: takeoff accepted"]


def test_of_a_group_each_robot_has_a_line_and_all_have_one_together(fleet, yard):
    yard.answers("rex", ACCEPTED)
    yard.answers("beast", DENIED)
    result = fleet("send", "ground", "takeoff")
    assert (result.code, len(result.out.splitlines())) == (7, 2)
    assert result.err == "1 of 2 ok; refused or failed: beast\n"


def test_when_no_robot_of_a_group_did_it_the_worst_counts(fleet, yard):
    """Nobody knows what a robot does that does not answer; one that refused does nothing."""
    yard.answers("rex", LATE)
    yard.answers("beast", DENIED)
    result = fleet("send", "ground", "takeoff")
    assert (result.code, result.err) == (6, "0 of 2 ok; not known: rex; refused or failed: beast\n")


def test_a_group_of_which_all_refuse_is_a_refusal(fleet, yard):
    yard.answers("rex", DENIED)
    yard.answers("beast", DENIED)
    assert fleet("send", "ground", "takeoff").code == 5


def test_a_robot_of_a_group_that_does_not_run_is_not_passed_over(fleet, play_edge):
    edge = play_edge("yard-1", robots={"rex": {"health": "ok"}}, groups={"ground": ["rex", "beast"]})
    edge.answers("rex", ACCEPTED)
    result = fleet("send", "ground", "takeoff")
    assert result.code == 7
    assert result.err.splitlines() == [
        "beast: takeoff timeout: it does not run on yard-1",
        "1 of 2 ok; not known: beast",
    ]


def test_an_empty_group_is_reported_as_such(fleet, play_edge):
    play_edge("yard-1", robots={"rex": {"health": "ok"}}, groups={"ground": []})
    assert "the group 'ground' is empty" in fleet("send", "ground", "land").err


def test_groups_of_one_name_on_two_edges_are_both_meant(fleet, yard, play_edge):
    barn = play_edge("barn", robots={"mule": {"health": "ok"}}, groups={"ground": ["mule"]})
    for edge, robot in ((yard, "rex"), (yard, "beast"), (barn, "mule")):
        edge.answers(robot, ACCEPTED)
    result = fleet("send", "ground", "takeoff")
    assert sorted(line.partition(":")[0] for line in result.out.splitlines()) == ["beast", "mule", "rex"]


def test_a_name_that_two_edges_have_is_not_guessed(fleet, yard, play_edge):
    barn = play_edge("barn", robots={"rex": {"health": "ok"}})
    there, here = yard.answers("rex", ACCEPTED), barn.answers("rex", ACCEPTED)
    result = fleet("send", "rex", "takeoff")
    assert result.code == 5
    assert "there are several robots 'rex' (say which one: barn/rex, yard-1/rex)" in result.err
    assert (there, here) == ([], [])
    assert fleet("send", "barn/rex", "takeoff").code == 0
    assert (len(there), len(here)) == (0, 1)


def test_a_robot_that_is_reached_by_two_ways_is_asked_once(fleet, play_edge, free_port):
    yard = play_edge("yard-1", robots={"rex": {"health": "ok"}}, listen=(f"tcp/127.0.0.1:{free_port}",))
    play_edge("barn", connect=(f"tcp/127.0.0.1:{free_port}",)).sees("yard-1")
    requested = yard.answers("rex", ACCEPTED)
    assert fleet("send", "rex", "takeoff").code == 0
    assert len(requested) == 1


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("send", "rex", "takeoff", "altitude"), "'altitude' is not key=value"),
        (("send", "rex", "takeoff", "=5"), "'=5' is not key=value"),
        (("send", "rex", "takeoff", "a=1", "a=2"), "a key is given twice"),
        (("send", "rex", "takeoff", "altitude=NaN"), "not finite"),
        (("send", "rex", "takeoff", "altitude=1e999"), "not finite"),
        (("goto", "rex", "nan", "0"), "'nan' is no number"),
        (("goto", "rex", "1", "0", "--speed", "inf"), "not finite"),
        (("goto", "rex", "here", "0"), "'here' is no number"),
        (("send", "rex", "land", "--timeout", "0"), "0 is not within 0 and 86400 seconds"),
        (("send", "rex", "land", "--timeout", "-1"), "is not within"),
        (("send", "rex", "land", "--timeout", "nan"), "is not within"),
        (("stop",), "name the robots to stop, or --all"),
        (("stop", "rex", "--all"), "name the robots to stop, or --all"),
    ],
)
def test_a_wrong_command_line_reaches_no_robot(fleet, yard, arguments, complaint):
    requested = yard.answers("rex", ACCEPTED)
    result = fleet(*arguments)
    assert result.code == 2
    assert complaint in result.err
    assert requested == []
    assert yard.stops == []


def test_data_too_deep_to_be_json_is_text(fleet, yard):
    requested = yard.answers("rex", ACCEPTED)
    deep = "[" * 100_000
    assert fleet("send", "rex", "takeoff", f"x={deep}").code == 0
    assert json.loads(requested[0].payload)["data"] == {"x": deep}


def test_a_goal_is_sent_as_navigation(fleet, yard):
    requested = yard.answers("rex", Reply("navigate", ReplyStatus.ACCEPTED))
    assert fleet("goto", "rex", "-10", "0.5", "5", "--yaw", "-1.5", "--speed", "2").code == 0
    message = json.loads(requested[0].payload)
    assert requested[0].parameters["kind"] == "navigate"
    assert (message["command"], message["position"], message["yaw"]) == ("goto", [-10.0, 0.5, 5.0], -1.5)
    assert message["constraints"] == {"max_speed_ms": 2.0}
    assert message["action_id"]


def test_a_place_on_earth_is_sent_as_such(fleet, yard):
    requested = yard.answers("rex", Reply("navigate", ReplyStatus.ACCEPTED))
    fleet("goto", "rex", "47.1", "-8.5", "20", "--geo")
    place = json.loads(requested[0].payload)["geodetic_position"]
    assert place == {"latitude": 47.1, "longitude": -8.5, "altitude": 20.0}


def test_no_two_goals_are_the_same_action(fleet, yard):
    requested = yard.answers("rex", Reply("navigate", ReplyStatus.ACCEPTED))
    for _ in range(2):
        fleet("goto", "rex", "1", "2")
    assert len({json.loads(question.payload)["action_id"] for question in requested}) == 2


def test_a_robot_that_is_not_found_may_be_of_the_edge_that_answers_nothing(fleet, yard, spawn_edge):
    spawn_edge("barn")
    result = fleet("send", "mule", "land")
    assert result.code == 5
    assert "edge barn runs but does not answer" in result.err


@pytest.mark.parametrize(
    "arguments", [("send", "rex", "land"), ("goto", "rex", "1", "2"), ("stop", "rex"), ("stop", "--all")]
)
def test_without_an_edge_nothing_is_claimed(fleet, runtime, arguments):
    result = fleet(*arguments)
    assert (result.code, result.out) == (4, "")
    assert "no edge is running here" in result.err
