"""Robots as missions use them: what each can, why it cannot take part, and whose rules apply."""

import types
import uuid

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.edge.mission_robots import (
    DESCRIBED_WITHIN,
    Descriptions,
    MissionRobots,
    RobotRules,
    can,
    candidate,
    trouble,
)
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.model.command import Origin, Transport
from fleet.model.description import CommandDescription, RobotDescription
from fleet.model.geometry import Vector3
from fleet.model.state import RobotState
from fleet.robot_config import Accepts, AdapterConfig

STATE = RobotState("rex", "t", "toy", "yard", 0.0, "ok", reachable=True, battery=80.0)
PLAIN = RobotDescription("rex", "toy", (CommandDescription("land"), CommandDescription("wave")))


def state(**fields):
    return msgspec.structs.replace(STATE, **fields)


def described(**fields):
    return msgspec.structs.replace(PLAIN, **fields)


@pytest.mark.parametrize(
    ("description", "more"),
    [
        (PLAIN, set()),
        (described(goals=True), {"goto", "path"}),
        (described(drives=True), {"follow"}),
        (described(goals=True, drives=True), {"goto", "path", "follow"}),
        (described(plans=("px4",)), set()),
    ],
)
def test_a_robot_can_do_its_commands_and_what_its_motion_allows(description, more):
    assert can(description) == {"land", "wave"} | more


def test_a_robot_that_flies_missions_can_do_plans_of_its_kinds_or_of_any():
    own = can(described(missions=True, plans=("px4",)))
    everything = can(described(missions=True))
    assert "plan" in own
    assert own < everything


def test_a_robot_that_nobody_described_can_do_nothing():
    assert can(None) == frozenset()


@pytest.mark.parametrize(
    ("fields", "description", "why"),
    [
        ({}, PLAIN, ""),
        ({}, None, "its worker does not say what it takes"),
        ({"reachable": False, "cause": "no cable"}, PLAIN, "it is offline: no cable"),
        ({"emergency_stop": True, "stop_cause": "anna"}, PLAIN, "its emergency stop is set: anna"),
        ({"reachable": False, "cause": "no cable", "emergency_stop": True}, None, "it is offline: no cable"),
    ],
)
def test_it_says_why_a_robot_cannot_take_part(fields, description, why):
    assert trouble(state(**fields), description) == why
    assert candidate(state(**fields), description, {}).trouble == why


def test_a_candidate_is_what_its_state_and_the_groups_say():
    groups = {"yard": ["rex", "ada"], "birds": ["kestrel"], "all": ["rex"]}
    found = candidate(state(run="3f2a", activity="goto 40 %", position=Vector3(1.0, 2.0, 3.0)), PLAIN, groups)
    assert (found.name, found.kind, found.run) == ("rex", "toy", "3f2a")
    assert found.groups == {"yard", "all"}
    assert (found.facts.battery, found.facts.position, found.facts.progress) == (
        80.0,
        (1.0, 2.0, 3.0),
        "goto 40 %",
    )


def test_a_candidate_is_where_the_site_sees_it():
    found = candidate(state(site=Vector3(7.0, 8.0, 9.0), position=Vector3()), None, {})
    assert found.facts.position == (7.0, 8.0, 9.0)
    assert candidate(STATE, None, {}).facts.position is None


def config(name, **fields):
    return AdapterConfig(name=name, twin=uuid.uuid4(), **fields)


def loaded(*robots):
    return types.SimpleNamespace(robots=[(robot, None) for robot in robots])


def admits(rules, robot, source_type):
    origin = Origin(Transport.CLOUD, source_type)
    return rules.policies[robot].mission_refusal(origin, commands=False, navigates=False) is None


def test_the_rules_of_each_robot_are_those_of_the_newest_configuration():
    tele = Accepts(mission=frozenset({"tele"}))
    rules = RobotRules(loaded(config("rex", accepts=tele, command_max_age=2.0), config("ada")))
    assert (admits(rules, "rex", "tele"), admits(rules, "ada", "tele")) == (True, False)
    assert rules.max_age["rex"] == 2.0
    policies = rules.policies
    rules.configure(loaded(config("ada", accepts=tele), config("max")))
    assert sorted(rules.policies) == sorted(rules.max_age) == ["ada", "max"]
    assert admits(rules, "ada", "tele")
    assert rules.policies is policies, "others hold on to it"
    rules.leave("stranger")


def made(kind, name, twin):
    """Return a robot of a kind, of which only its name and twin are known."""
    robot = object.__new__(kind)
    robot.name, robot.twin = name, twin
    robot.state = robot.describe = lambda: name
    robot.read = lambda kind, payload, **more: (name, kind, payload, more)
    return robot


@pytest.fixture
def robots():
    partner = types.SimpleNamespace(name="own", edge="barn")
    here, there = made(LocalRobot, "rex", "t1"), made(RemoteRobot, "ada", "t2")
    return MissionRobots("yard", [here, there], {"own": partner}, lambda twin: f"sender of {twin}")


def test_the_robots_of_this_edge_and_of_its_partners_are_known_by_name(robots):
    assert (list(robots.here), list(robots.remote)) == (["rex"], ["ada"])
    assert list(robots.ours) == ["rex", "ada"]
    assert sorted(robots.everyones) == ["ada", "own", "rex"]
    assert robots.edges == {"own": "barn", "ada": "yard"}, "who describes those of other processes"
    assert robots.names == {"t1": "rex", "t2": "ada"}
    assert robots.senders == {"rex": "sender of t1", "ada": "sender of t2"}


@pytest.mark.parametrize("name", ["rex", "ada"])
def test_a_robot_is_read_and_seen_as_it_is(robots, name):
    found = robots.ours[name]
    assert (found.name, found.state()) == (name, name)
    more = {"transport": Transport.BUS, "request_id": "1", "waits": True}
    plain = {"transport": Transport.MISSION, "request_id": "", "waits": False}
    assert found.read("navigate", b"", transport=Transport.MISSION) == (name, "navigate", b"", plain)
    assert found.read("command", b"{}", **more) == (name, "command", b"{}", more)


def test_a_robot_of_this_process_describes_itself(robots):
    assert robots.here["rex"].describe() == "rex"


def test_a_robot_that_leaves_is_gone_from_everywhere(robots):
    assert robots.leave("ada") == "t2"
    for table in (robots.here, robots.remote, robots.ours, robots.everyones, robots.edges, robots.senders):
        assert "ada" not in table
    assert robots.names == {"t1": "rex"}
    assert robots.leave("ada") == ""


def test_a_twin_that_another_robot_has_by_now_stays_its_own(robots):
    robots.join(made(LocalRobot, "max", "t1"))
    assert robots.leave("rex") == ""
    assert robots.names["t1"] == "max"


class Control:
    """The bus on which descriptions are asked for; the test answers."""

    def __init__(self):
        self.asked = {}

    def request_later(self, key, payload, *, timeout, on_answer, on_end):
        assert (payload, timeout) == (b"", DESCRIBED_WITHIN)
        self.asked[key] = on_answer, on_end


@pytest.mark.parametrize("answered", [True, False])
def test_descriptions_are_waited_for_until_each_has_come_or_nobody_answers(answered):
    control, soon, then = Control(), [], []
    descriptions = Descriptions(control, soon.append, {"ada": "yard", "own": "barn"})
    descriptions.request(lambda: then.append("then"))
    assert sorted(control.asked) == sorted([keys.description("barn", "own"), keys.description("yard", "ada")])
    for key, (on_answer, on_end) in control.asked.items():
        assert then == []
        if answered:
            on_answer(msgspec.json.encode(described(robot=key)))
        on_end()
        while soon:
            soon.pop(0)()
    assert then == ["then"]
    assert (descriptions.of("ada") is not None) is answered


def test_without_robots_elsewhere_nothing_is_waited_for():
    soon = []
    Descriptions(Control(), soon.append, {}).request(lambda: None)
    assert len(soon) == 1
