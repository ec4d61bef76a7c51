"""Runs of an edge whose robots answer by hand: recorded, commanded, given back, taken up again."""

import pytest

from fleet.config.missions import mission_of
from fleet.errors import Refused
from fleet.missions.filling import rehearse_command
from fleet.missions.report import MissionStartRequest, RunControlRequest
from fleet.missions.runs import BACK_WITHIN, JOIN_WITHIN
from fleet.model.command import Transport
from tests.fleet.missions.yard import MISSION


def test_a_run_goes_through_its_steps_and_gives_its_robots_back(yard):
    ((run, roles, refusal),) = yard.start()
    assert (run, roles, refusal) == ("3f2a", {"eye": ["kestrel"], "feet": ["beast"]}, "")
    yard.done("kestrel", "takeoff")
    yard.done("kestrel", "goto")
    yard.done("beast", "goto")
    assert yard.last.outcome == "completed"
    assert {robot.now.run for robot in yard.robots.values()} == {""}
    identities = [identity for robot in yard.robots.values() for _, identity in robot.requests if identity]
    assert identities[0] == "3f2a/up.1/kestrel/1"
    assert len(identities) == len(set(identities)) == 3


@pytest.mark.parametrize("refuses", [True, False], ids=["first refused", "first ended"])
def test_a_state_that_still_names_a_run_which_has_ended_keeps_no_robot_from_the_next(yard, refuses):
    if refuses:
        yard.robots["kestrel"].refuses["join_run"] = "anna has control for 2.0 s more"
        yard.start()
        del yard.robots["kestrel"].refuses["join_run"]
    else:
        yard.start()
        for robot, command in (("kestrel", "takeoff"), ("kestrel", "goto"), ("beast", "goto")):
            yard.done(robot, command)
    assert yard.runs.states() == []
    yard.robots["beast"].be(run="3f2a")  # sent by its worker before it was told to leave
    ((run, _, refusal),) = yard.start(run="77b0")
    assert (run, refusal) == ("77b0", "")


def test_a_robot_that_does_not_join_keeps_everybody_standing(yard):
    yard.robots["beast"].refuses["join_run"] = "anna has control for 2.0 s more"
    ((run, _, refusal),) = yard.start()
    assert (run, refusal) == ("", "beast: anna has control for 2.0 s more")
    assert yard.robots["kestrel"].now.run == ""
    assert yard.robots["kestrel"].names == yard.robots["beast"].names == []


def test_a_robot_that_does_not_answer_is_not_waited_for_for_ever(yard):
    yard.robots["beast"].read = lambda *_, **__: None
    assert yard.start() == []
    yard.turn(JOIN_WITHIN + 1)
    assert yard.robots["kestrel"].now.run == ""
    assert yard.runs.states() == []


def test_who_may_not_command_a_robot_gains_nothing_by_a_mission(yard):
    yard.denied["beast", Transport.CLOUD] = "source_type 'edit'; this robot accepts tele"
    ((run, _, refusal),) = yard.start(transport=Transport.CLOUD, source_type="edit")
    assert (run, refusal) == ("", "beast: source_type 'edit'; this robot accepts tele")
    assert all(robot.requests == [] for robot in yard.robots.values())


def test_a_repeat_of_a_start_is_the_same_run(yard):
    yard.start()
    ((run, _, refusal),) = yard.start()
    assert (run, refusal) == ("3f2a", "")
    assert yard.robots["kestrel"].names == ["takeoff"]


def test_a_mission_that_must_be_rehearsed_is_refused(yard):
    ((_, _, refusal),) = yard.start({**MISSION, "rehearse": "required"})
    assert "rehearsed" in refusal


def test_a_mission_that_must_be_rehearsed_is_started_by_a_pass_of_its_robots_where_they_are(yard):
    asked = []
    yard.runs.filling.rehearsed = lambda *given: asked.append(given[1:]) or ""
    ((run, _, refusal),) = yard.start({**MISSION, "rehearse": "required"})
    assert (run, refusal) == ("3f2a", "")
    assert asked == [({"eye": ["kestrel"], "feet": ["beast"]}, {"kestrel": None, "beast": None})]


def test_who_is_refused_for_want_of_a_rehearsal_is_shown_what_to_type():
    ask = MissionStartRequest(inputs={"height": 4}, robots={"eye": ["kestrel"]})
    assert rehearse_command("patrol", ask) == "fleet mission rehearse patrol height=4 --robot eye=kestrel"
    assert rehearse_command("patrol", MissionStartRequest(mission=MISSION)) == "fleet mission rehearse FILE"


def test_a_stop_of_everything_ends_every_run(yard):
    yard.start()
    yard.runs.stopped((), "anna")
    yard.settle()
    assert yard.last.outcome == "aborted"
    assert "land" not in yard.robots["kestrel"].names


def test_a_stop_of_one_robot_is_seen_and_no_more(yard):
    yard.start()
    yard.runs.stopped(("beast", "beast"), "anna")
    assert yard.last.outcome == ""


def test_a_killed_edge_begins_nothing_twice_and_asks(yard):
    yard.start()
    yard.begin()
    yard.robots["kestrel"].be(run="", reachable=False)
    yard.runs.restore_runs()
    yard.turn()
    assert yard.runs.states() == [], "its robots are not back yet"
    yard.robots["kestrel"].be(reachable=True)
    yard.robots["beast"].be(run="")
    yard.turn()
    assert yard.robots["kestrel"].names == ["takeoff", "stop"]
    question = yard.last.question
    assert "restarted in step up.1" in question.text
    yard.done("kestrel", "stop")
    yard.done("beast", "stop")
    assert yard.control("3f2a", RunControlRequest("answer", question=question.id, goes_on=True)) == ""
    yard.settle()
    yard.done("kestrel", "goto")
    yard.done("beast", "goto")
    assert yard.last.outcome == "completed"
    assert yard.robots["kestrel"].names == ["takeoff", "stop", "goto"]


def test_a_robot_that_does_not_come_back_is_lost(yard):
    yard.start()
    yard.begin()
    for robot in yard.robots.values():
        robot.be(run="")
    yard.robots["kestrel"].be(reachable=False)
    yard.runs.restore_runs()
    yard.turn(BACK_WITHIN + 1)
    assert {robot.robot: robot.outcome for robot in yard.last.robots}["kestrel"] == "lost"


def test_a_run_waits_for_an_event_of_its_robots(yard):
    seen = {"role": "eye", "event": "person_seen", "timeout": "1 min"}
    steps = [{"id": "look", "wait_for": seen}, {"id": "up", "do": {"eye": "takeoff"}}]
    yard.start({**MISSION, "steps": steps})
    yard.runs.handle_event("beast", "person_seen")
    yard.turn()
    assert yard.robots["kestrel"].names == []
    yard.runs.handle_event("kestrel", "person_seen")
    yard.turn()
    assert yard.robots["kestrel"].names == ["takeoff"]


def test_controls_tell_why_they_are_refused(yard):
    yard.start()
    assert yard.control("77", RunControlRequest("abort")) == "there is no run '77' under way"
    assert yard.control("3f2a", RunControlRequest("answer")) == "it asks nothing"
    assert yard.control("3f2a", RunControlRequest("resume")) == "not possible while it is step"
    assert yard.control("3f2a", RunControlRequest("pause")) == ""
    assert yard.control("3f2a", RunControlRequest("abort")) == ""


def test_a_robot_of_a_run_that_is_taken_up_again_is_given_to_no_other_run(yard):
    yard.start()
    yard.begin()
    for robot in yard.robots.values():
        robot.be(run="", reachable=False)
    yard.runs.restore_runs()
    other = mission_of("other", {**MISSION, "steps": MISSION["steps"][:1]})
    began, ask = [], MissionStartRequest(run="77")
    yard.runs.start(other, other.program({}), ask, Transport.MISSION, lambda *given: began.append(given))
    assert "kestrel: it is in run 3f2a" in began[0][2]
    assert yard.runs.filling.conflicting_runs(other, other.program({}), ask) == ["3f2a"]


def test_what_is_refused_anyway_has_no_run_in_its_way(yard):
    yard.start()
    other = mission_of("patrol", {**MISSION, "rehearse": "required"})
    with pytest.raises(Refused, match="rehearsed"):
        yard.runs.filling.conflicting_runs(other, other.program({}), MissionStartRequest(run="77"))


def test_a_step_that_leads_a_robot_through_its_fence_is_refused_before_anything_moves(yard):
    yard.hindered["beast", "goto"] = "goal 1 is outside the fence"
    ((run, _, refusal),) = yard.start()
    assert (run, refusal) == ("", "beast: step go: goal 1 is outside the fence")
    assert all(robot.requests == [] for robot in yard.robots.values())


def test_who_follows_gets_its_leader_and_ends_with_the_step(yard):
    yard.can = {"goto", "follow"}
    do = {"feet": {"goto": [1, 2]}, "eye": {"follow": "feet", "distance": 4, "speed": 2}}
    yard.start({**MISSION, "steps": [{"id": "round", "do": do}]})
    said = yard.robots["kestrel"].messages[-1]
    assert {key: said[key] for key in said if key not in ("timestamp", "session_id")} == {
        "command": "follow",
        "action_id": "3f2a/round.1/kestrel/1",
        "robot": "beast",
        "distance_m": 4.0,
        "constraints": {"max_speed_ms": 2.0},
    }
    yard.done("beast", "goto")
    assert yard.robots["kestrel"].names == ["follow", "stop"]
    yard.done("kestrel", "stop")
    assert yard.last.outcome == "completed"
