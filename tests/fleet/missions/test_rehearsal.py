"""When a rehearsal that was passed lets a mission be started."""

import msgspec
import pytest

from fleet.missions.program import Act, Do, Program
from fleet.missions.rehearsal import FRESH, Present, RehearsalResult, StoredPass, program_digest, refusal

PROGRAM = Program("patrol", (Do("up", {"eye": (Act("command", "takeoff", {"altitude": 5}),)}),), {"eye": 1})
HIGHER = Program("patrol", (Do("up", {"eye": (Act("command", "takeoff", {"altitude": 9}),)}),), {"eye": 1})
ROLES = {"eye": ["kestrel"]}
PASSED = StoredPass("patrol", program_digest(PROGRAM), "c1", ROLES, {"kestrel": (0.0, 1.0, 0.0)}, 1000.0)
NOW = Present(PROGRAM, "c1", 1000.0 + FRESH, {"kestrel": (0.0, 4.0, 0.0), "rex": None}, ROLES)


def why(*passes, **fields):
    return refusal(passes, msgspec.structs.replace(NOW, **fields))


def test_a_pass_of_the_same_within_an_hour_and_three_metres_counts():
    assert why(PASSED) == ""
    assert why(msgspec.structs.replace(PASSED, config="c0"), PASSED) == ""


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"program": HIGHER}, "it has not been rehearsed with these inputs"),
        ({"config": "c2"}, "fleet.yaml has changed since the rehearsal"),
        ({"now": 1000.1 + FRESH}, "the rehearsal is more than an hour old"),
        ({"now": 999.0}, "the rehearsal is more than an hour old"),
        ({"roles": {"eye": ["falcon"]}}, "it was rehearsed with others: eye: kestrel"),
        ({"places": {"kestrel": (0.0, 4.1, 0.0)}}, "kestrel is 3.1 m from where it was at the rehearsal"),
        ({"places": {"kestrel": None}}, "the position of kestrel is unknown"),
        ({"places": {}}, "the position of kestrel is unknown"),
    ],
)
def test_a_pass_of_anything_else_does_not_and_says_why(fields, said):
    assert why(PASSED, **fields) == said


def test_nothing_counts_where_nothing_was_rehearsed():
    assert why() == "it has not been rehearsed with these inputs"


def test_the_newest_pass_says_why_none_counts():
    older = msgspec.structs.replace(PASSED, config="c0")
    assert why(PASSED, older, roles={"eye": ["falcon"]}).startswith("it was rehearsed with others")


def test_while_roles_cannot_be_filled_robots_and_places_are_not_compared():
    assert why(PASSED, roles=None, places={}) == ""


def test_a_rehearsal_with_troubles_is_no_pass():
    assert RehearsalResult("patrol", "completed", 1.0).passed
    assert not RehearsalResult("patrol", "completed", 1.0, troubles=("too near",)).passed
