"""Roles of a mission within a mission are filled from the robots of the role that carries it."""

import pytest

from fleet.config.missions import mission_of
from fleet.errors import Refused
from fleet.missions.filling import Filling, members_of, needs_of
from fleet.missions.plan import plans_taken
from fleet.missions.report import MissionStartRequest
from fleet.missions.roles import RoleCandidate
from fleet.missions.state import Facts

SCAN = {
    "version": 1,
    "roles": {"eye": {"can": ["takeoff"]}, "feet": {"count": {"min": 1, "max": 2}}},
    "steps": [
        {"id": "up", "do": {"eye": "takeoff"}},
        {"id": "go", "do": {"all": {"goto": [1, 2]}}},
    ],
}
OUTER = {
    "version": 1,
    "roles": {"team": {"count": {"min": 2, "max": 3}}},
    "steps": [{"id": "look", "do": {"team": {"mission": "scan"}}}],
}


def robot(name, *can, battery=80.0):
    return RoleCandidate(name, "ugv", frozenset(can), Facts(name, "ok", battery))


def fill(*robots, scan=SCAN, outer=OUTER):
    mission = mission_of("patrol", outer, {"scan": mission_of("scan", scan)})
    program = mission.program({})
    return program, Filling(lambda: list(robots), list, bool).fill(mission, program, MissionStartRequest())


def test_each_robot_gets_a_role_that_it_is_good_for():
    robots = robot("ada", "goto"), robot("bob", "goto"), robot("cid", "goto", "takeoff", battery=20.0)
    program, roles = fill(*robots)
    assert roles == {"team": ["ada", "bob", "cid"], "look.eye": ["cid"], "look.feet": ["ada", "bob"]}
    plays = {member.robot: member.plays for member in members_of(program, roles)}
    assert plays["bob"] == {"look.feet": 1, "look.all": 1}
    assert list(plays["cid"]) == ["look.eye", "look.all"], "a role comes before all"


def test_a_role_of_it_that_none_of_them_can_fill_is_refused_with_what_each_lacks():
    with pytest.raises(
        Refused, match=r"role look.eye needs 1, 0 can: ada: has no takeoff; bob: has no takeo"
    ):
        fill(robot("ada", "goto"), robot("bob", "goto"))


def test_a_role_that_carries_a_mission_with_one_role_takes_robots_that_can_carry_it_out():
    outer = {**OUTER, "roles": {"team": {}}}
    scan = {**SCAN, "roles": {"eye": {}}}
    program, roles = fill(robot("ada", "goto"), robot("bob", "goto", "takeoff"), scan=scan, outer=outer)
    assert roles == {"team": ["bob"], "look.eye": ["bob"]}
    assert needs_of(program)["team"] == {"goto", "takeoff"}


def test_it_requires_more_of_its_robots_than_the_others_need():
    scan = {**SCAN, "require": {"battery": {"min": 50}}}
    with pytest.raises(Refused, match="cid: its battery is at 20 %, 50 % is required"):
        fill(robot("ada", "goto"), robot("cid", "goto", "takeoff", battery=20.0), scan=scan)


def test_a_plan_is_flown_by_a_robot_of_the_autopilot_that_it_was_made_for():
    items = [{"type": "waypoint", "latitude": 47.4, "longitude": 8.5, "altitude_m": 8}]
    plan = {"contract": "aerial.mission.v1", "name": "field", "items": items, "made_for": ["px4"]}
    flies = {
        "version": 1,
        "roles": {"eye": {}},
        "steps": [{"id": "up", "do": {"eye": "takeoff"}}, {"id": "fly", "do": {"eye": {"plan": plan}}}],
    }
    ada = robot("ada", "takeoff", *plans_taken({"ardupilot", "multirotor"}), battery=90.0)
    bob = robot("bob", "takeoff", *plans_taken({"px4", "multirotor"}), battery=20.0)
    mission = mission_of("survey", flies)
    program = mission.program({})
    filled = Filling(lambda: [ada, bob], list, bool).fill(mission, program, MissionStartRequest())
    assert filled == {"eye": ["bob"]}, "the fuller one has another autopilot"
    with pytest.raises(Refused, match="ada: flies no plan made for px4"):
        Filling(lambda: [ada], list, bool).fill(mission, program, MissionStartRequest())
