import pytest

from fleet.errors import Refused
from fleet.missions.model import CountConfig, RoleConfig
from fleet.missions.program import Require
from fleet.missions.roles import RoleCandidate, conflicting_runs, filled
from fleet.missions.state import Facts


def robot(name, kind="ugv", *, can=("goto",), battery=80.0, groups=(), trouble="", health="ok", run=""):
    facts = Facts(name, health, battery)
    return RoleCandidate(name, kind, frozenset(can), facts, frozenset(groups), trouble, run)


def role(least=1, most=1, **fields):
    fields = {"from": fields.pop("of")} | fields if "of" in fields else fields
    return RoleConfig(count=CountConfig(min=least, max=most), **fields)


def fill(roles, *robots, needs=None, require=None, given=None):
    return filled(roles, needs or {}, robots, require or Require(), given or {})


def test_the_fullest_battery_is_taken_then_the_name_decides():
    robots = robot("ada", battery=50.0), robot("bob"), robot("abe")
    assert fill({"feet": role()}, *robots) == {"feet": ["abe"]}


def test_a_role_takes_up_to_its_most_but_leaves_other_roles_their_least():
    robots = [robot(name, groups=["yard"]) for name in ("a", "b", "c")]
    found = fill({"first": role(1, 4, of="yard"), "second": role(1, 1)}, *robots)
    assert sorted(map(len, found.values())) == [1, 2]
    assert len({name for names in found.values() for name in names}) == 3


def test_the_role_with_the_fewest_candidates_chooses_first():
    robots = robot("drone", "mavlink", battery=100.0), robot("base", battery=10.0)
    found = fill({"any": role(), "eye": role(kind="mavlink")}, *robots)
    assert found == {"any": ["base"], "eye": ["drone"]}


def test_a_person_may_choose():
    found = fill({"feet": role()}, robot("ada"), robot("bob"), given={"feet": ["bob"]})
    assert found == {"feet": ["bob"]}


def test_what_each_candidate_lacks_is_reported():
    robots = (
        robot("ada", can=()),
        robot("bob", battery=20.0),
        robot("cid", trouble="it is offline: no cable"),
        robot("dan", health="fault"),
        robot("eve", battery=None),
    )
    with pytest.raises(Refused) as caught:
        fill(
            {"feet": role(2, 2)},
            *robots,
            needs={"feet": frozenset({"goto"})},
            require=Require(battery_min=60),
        )
    for words in (
        "role feet needs 2, 0 can: ",
        "bob: its battery is at 20 %, 60 % is required",
        "ada: has no goto",
        "cid: it is offline: no cable",
        "dan: its health is fault, degraded is required",
        "eve: its battery is unknown",
    ):
        assert words in str(caught.value)


def conflicting(roles, *robots):
    return conflicting_runs(roles, {}, robots, Require(), {})


def test_a_robot_in_a_run_fills_no_role():
    with pytest.raises(Refused, match="a: it is in run r1"):
        fill({"feet": role()}, robot("a", run="r1"))


def test_no_more_runs_are_in_the_way_than_have_robots_that_are_needed():
    robots = robot("a", run="r1"), robot("b", run="r2"), robot("c", run="r2"), robot("d")
    assert conflicting({"feet": role(1, 4)}, *robots) == set()
    assert conflicting({"feet": role(2, 4)}, *robots) == {"r2"}
    assert conflicting({"feet": role(4, 4)}, *robots) == {"r1", "r2"}


def test_a_role_that_nobody_could_fill_even_then_is_refused():
    with pytest.raises(Refused, match="b: its emergency stop is set"):
        conflicting(
            {"feet": role(2, 2)}, robot("a", run="r1"), robot("b", trouble="its emergency stop is set")
        )
