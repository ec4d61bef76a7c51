"""What a mission may say: each act, step, input and condition alone, with the reason of each refusal."""

import math

import pytest
from pydantic import ValidationError

from fleet.missions.model import (
    NEVER_REPEATED,
    REPEATABLE,
    VERBS,
    ActConfig,
    AskConfig,
    ConditionConfig,
    CountConfig,
    MissionConfig,
    RoleConfig,
    StepConfig,
)
from fleet.missions.points import MOST_POINTS

VALUES = {
    "command": "takeoff",
    "goto": "gate",
    "path": [[0, 0], [1, 1]],
    "plan": "field.plan",
    "follow": "eye",
    "mission": "scan",
}


def why(model, **fields):
    """Return why a model refuses fields, as its first sentence; empty if it takes them."""
    try:
        model.model_validate(fields)
    except ValidationError as error:
        return error.errors()[0]["msg"].removeprefix("Value error, ")
    return ""


@pytest.mark.parametrize("verb", VERBS)
def test_an_act_is_what_its_one_verb_says(verb):
    assert ActConfig.model_validate({verb: VALUES[verb]}).verb == verb


@pytest.mark.parametrize("said", [(), ("command", "goto"), ("follow", "mission"), VERBS])
def test_an_act_has_exactly_one_verb(said):
    needed = "needs exactly one of command, goto, path, plan, follow, mission"
    assert why(ActConfig, **{verb: VALUES[verb] for verb in said}) == needed


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize(
    ("key", "value", "verbs", "refusal"),
    [
        ("with", {"altitude": 5}, {"command", "mission"}, "is the data of a command or the inputs"),
        ("speed", 1.5, {"goto", "path", "follow"}, "is allowed only with goto, path and follow"),
        ("distance", 4, {"follow"}, "is allowed only with follow"),
        ("retry", 1, set(REPEATABLE), "is allowed only with goto and path: "),
    ],
)
def test_what_is_said_of_some_acts_is_refused_of_the_others(verb, key, value, verbs, refusal):
    refused = why(ActConfig, **{verb: VALUES[verb], key: value})
    assert refused == "" if verb in verbs else refused.startswith(refusal)


@pytest.mark.parametrize("verb", VERBS)
def test_only_an_act_that_ends_by_itself_has_a_timeout(verb):
    refused = why(ActConfig, **{verb: VALUES[verb], "timeout": "30 s"})
    expected = {"mission": "a mission has a deadline of its own", "follow": "it follows until the others"}
    assert refused.startswith(expected.get(verb, ""))
    assert bool(refused) == (verb in expected)


@pytest.mark.parametrize("command", sorted(NEVER_REPEATED))
def test_what_must_not_be_done_twice_is_never_tried_again(command):
    assert why(ActConfig, command=command, retry=1) == (
        f"is allowed only with goto and path: {command} must not be done twice"
    )
    assert why(ActConfig, command=command, retry=0) == ""


def test_any_other_command_is_not_known_to_bear_a_retry():
    assert why(ActConfig, command="wave", retry=1) == (
        "is allowed only with goto and path: wave is not known to bear it"
    )


@pytest.mark.parametrize(
    ("key", "fits", "not_"),
    [("distance", (0.5, 100), (0.49, 100.1)), ("speed", (0.01, 100), (0, 100.1)), ("retry", (0, 5), (-1, 6))],
)
def test_distance_speed_and_retries_are_bounded(key, fits, not_):
    act = {"follow": "eye"} if key == "distance" else {"goto": "gate"}
    assert [why(ActConfig, **act, **{key: each}) for each in fits] == ["", ""]
    assert all(why(ActConfig, **act, **{key: each}) for each in not_)
    assert why(ActConfig, **act, **{key: math.nan})


@pytest.mark.parametrize(
    ("goto", "refusal"),
    [
        ("gate", ""),
        ([1, 2], ""),
        ([1, 2, 3], ""),
        ({"lat": 47, "lon": 8}, ""),
        ({"lat": 47, "lon": 8, "alt": 12}, ""),
        ([1], "a point is"),
        ([1, math.inf], "a point is"),
        ({"lat": 91, "lon": 8}, "lat and lon are degrees"),
        (7, "a point is"),
    ],
)
def test_a_goal_is_a_place_or_a_point(goto, refusal):
    refused = why(ActConfig, goto=goto)
    assert refused.startswith(refusal)
    assert bool(refused) == bool(refusal)


A_PATH = [[0, 0], [1, 1, 4]]
EACH = "a list of paths has a file or a list of points for each robot"


@pytest.mark.parametrize(
    ("path", "refusal"),
    [
        ("way.csv", ""),
        (A_PATH, ""),
        ([A_PATH, A_PATH], ""),
        (["way.csv", A_PATH], ""),
        (["one.csv", "two.csv"], ""),
        ([{"lat": 47, "lon": 8}], ""),
        ([[0, 0]] * MOST_POINTS, ""),
        ([[0, 0]] * (MOST_POINTS + 1), f"a path is a file, or a list of 1 to {MOST_POINTS} points"),
        ([], f"a path is a file, or a list of 1 to {MOST_POINTS} points"),
        ({"lat": 47, "lon": 8}, f"a path is a file, or a list of 1 to {MOST_POINTS} points"),
        (["way.csv", [0, 0]], EACH),
        ([A_PATH, [0, 0]], EACH),
        ([A_PATH, 7], EACH),
        ([[0, math.nan]], "a point is"),
        ([A_PATH, [[0]]], "a point is"),
    ],
)
def test_a_path_is_a_file_or_points_for_all_robots_or_for_each(path, refusal):
    refused = why(ActConfig, path=path)
    assert refused.startswith(refusal)
    assert bool(refused) == bool(refusal)


ACTIONS = {
    "do": {"all": {"command": "land"}},
    "wait": "5 s",
    "wait_for": {"role": "all", "health": "ok", "timeout": "5 s"},
    "ask": {"text": "Go on?"},
    "repeat": {"times": 2, "steps": [{"id": "rest", "wait": 5}]},
}


@pytest.mark.parametrize("action", ACTIONS)
def test_a_step_does_one_thing(action):
    needed = "a step needs exactly one of do, wait, wait_for, ask, repeat"
    assert why(StepConfig, id="x", **{action: ACTIONS[action]}) == ""
    other = "wait" if action != "wait" else "ask"
    assert why(StepConfig, id="x", **{action: ACTIONS[action], other: ACTIONS[other]}) == needed
    assert why(StepConfig, id="x") == needed


@pytest.mark.parametrize("action", ACTIONS)
@pytest.mark.parametrize(("key", "value"), [("start", "together"), ("undo", {"all": {"command": "land"}})])
def test_only_a_step_of_robots_starts_together_or_is_undone(action, key, value):
    refused = why(StepConfig, **{"id": "x", action: ACTIONS[action], key: value})
    assert refused == ("" if action == "do" else "is allowed only in a step with do")


def test_a_step_of_no_role_is_refused():
    assert why(StepConfig, id="x", do={}) == "names no role"


def test_a_mission_is_alone_in_its_step():
    scan = {"mission": "scan", "with": {"height": 5}}
    assert StepConfig.model_validate({"id": "x", "do": {"eye": scan}}).mission[0] == "eye"
    assert StepConfig.model_validate({"id": "x", "do": {"eye": {"goto": "gate"}}}).mission is None
    assert StepConfig.model_validate({"id": "x", "wait": 5}).mission is None
    both = {"eye": {"goto": "gate"}, "feet": scan}
    assert why(StepConfig, id="x", do=both).startswith("a mission is alone in its step")


@pytest.mark.parametrize(
    ("key", "value"),
    [("start", "together"), ("undo", {"eye": {"command": "land"}}), ("timeout", 600.0), ("finish", "all")],
)
def test_a_step_with_a_mission_leaves_to_it_what_is_said_of_steps(key, value):
    """Also where the value is the default: it would have no effect."""
    refused = why(StepConfig, **{"id": "x", "do": {"eye": {"mission": "scan"}}, key: value})
    assert refused == "is allowed only in the steps of the mission that this step carries out"


@pytest.mark.parametrize("count", range(4))
def test_a_condition_is_on_one_thing(count):
    fields = dict(list({"battery": {"max": 40}, "health": "ok", "event": "person_seen"}.items())[:count])
    refused = why(ConditionConfig, role="eye", **fields)
    assert refused == ("" if count == 1 else "needs exactly one of battery, health and event")


@pytest.mark.parametrize(("percent", "fits"), [(0, True), (100, True), (-0.1, False), (100.1, False)])
def test_a_battery_is_between_0_and_100_percent(percent, fits):
    assert (why(ConditionConfig, role="eye", battery={"min": percent}) == "") is fits
    assert (why(ConditionConfig, role="eye", battery={"max": percent}) == "") is fits


@pytest.mark.parametrize(
    ("fields", "refusal"),
    [
        ({"min": 2, "max": 2}, ""),
        ({"min": 3, "max": 2}, "is more than max"),
        ({"min": 0}, "Input should be greater than or equal to 1"),
        ({"max": 1001}, "Input should be less than or equal to 1000"),
    ],
)
def test_a_role_has_at_least_one_robot_and_no_more_than_its_most(fields, refusal):
    assert why(CountConfig, **fields) == refusal


def test_a_role_that_says_nothing_is_one_robot_of_any_kind():
    role = RoleConfig()
    assert (role.count.min, role.count.max, role.spares, role.from_, role.can) == (1, 1, 0, None, ())


def test_a_question_waits_ten_minutes_and_then_ends_the_run():
    assert (AskConfig(text="Go on?").timeout, AskConfig(text="Go on?").on_timeout) == (600.0, "abort")
    assert why(AskConfig, text="")
    assert why(AskConfig, text="x" * 501)


def test_the_mildest_of_all_is_what_a_mission_does_by_default():
    steps = [{"id": "rest", "wait": 5}]
    mission = MissionConfig.model_validate({"version": 1, "roles": {"a": {}}, "steps": steps})
    assert (mission.on_failure, mission.on_abort, mission.on_restart) == ("hold", "hold", "hold_and_ask")
    assert (mission.deadline, mission.occupy_within, mission.require.health) == (None, 600.0, "degraded")
