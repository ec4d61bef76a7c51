"""What a run does, in plain values: read back from the disk as they were; requirements add up."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.missions.program import (
    Act,
    Again,
    Ask,
    Condition,
    Do,
    Enter,
    Inner,
    Leave,
    Loop,
    Program,
    Require,
    RoleNeed,
    Wait,
    WaitFor,
)

bounds = st.none() | st.floats(0, 100)
requires = st.builds(Require, st.sampled_from(["ok", "degraded"]), bounds, bounds)
GO = (Act("goto", [1, 2.5], speed=1.5, timeout=60.0, retry=2),)
TAKEOFF = (Act("command", "takeoff", {"altitude": 5}),)
CONDITION = Condition("eye", every=True, battery_min=30, battery_max=90)
STEPS = (
    Do("up", {"eye": TAKEOFF, "feet": GO}, CONDITION, "eye", together=True, failed_do="land"),
    Do("go", {"all": GO}, failed_then="wait", undo={"all": TAKEOFF}, require=Require("ok", 30.0)),
    Wait("rest", 5.0, Condition("all", health="ok")),
    WaitFor("look", Condition("eye", event="person_seen"), 60.0, fails=False),
    Ask("sure", "Go on?", 60.0, "continue"),
    Loop("again", 3, 7, CONDITION),
    Again(5),
    Enter("in", "scan", "in.all", 9, {"in.eye": 1}, 300.0, "land", "fail"),
    Leave(7),
)


@pytest.mark.parametrize("step", STEPS, ids=lambda step: type(step).__name__)
def test_an_instruction_is_read_back_from_the_disk_as_it_was(step):
    program = Program("patrol", (step,), {})
    assert msgspec.json.decode(msgspec.json.encode(program), type=Program) == program


def test_a_whole_mission_is_read_back_from_the_disk_as_it_was():
    program = Program(
        "patrol",
        STEPS,
        {"eye": 1},
        Require("ok", 20.0, 90.0),
        ("gate",),
        30.0,
        900.0,
        "undo",
        "land",
        "continue",
        {"in": Inner("feet", {"in.eye": RoleNeed(1, 2, "yard", "ugv", ("goto",))}, Require())},
    )
    assert msgspec.json.decode(msgspec.json.encode(program), type=Program) == program


def test_the_words_of_an_act_are_its_command_or_its_verb():
    assert Act("command", "takeoff").words == "takeoff"
    assert Act("goto", "gate").words == "goto"
    assert Act("follow", "eye").words == "follow"


@pytest.mark.parametrize(
    ("one", "other", "both"),
    [
        (Require(), Require(), Require()),
        (Require("ok"), Require(), Require("ok")),
        (Require(), Require("ok"), Require("ok")),
        (Require("degraded", 30.0), Require("ok", 60.0), Require("ok", 60.0)),
        (Require("degraded", 60.0), Require("degraded", 30.0), Require("degraded", 60.0)),
        (Require("degraded", None, 90.0), Require("degraded", None, 80.0), Require("degraded", None, 80.0)),
        (Require("degraded", 0.0), Require("degraded", None, 0.0), Require("degraded", 0.0, 0.0)),
    ],
)
def test_two_requirements_together_are_the_stricter_of_each(one, other, both):
    assert one.with_(other) == both


@given(one=requires, other=requires, charge=st.floats(0, 100))
def test_what_meets_two_requirements_together_meets_each_of_them(one, other, charge):
    meets = lambda require: (  # noqa: E731
        (require.battery_min is None or charge >= require.battery_min)
        and (require.battery_max is None or charge <= require.battery_max)
    )
    both = one.with_(other)
    assert meets(both) == (meets(one) and meets(other))
    assert (both.health == "ok") == ("ok" in (one.health, other.health))
    assert both == other.with_(one)
