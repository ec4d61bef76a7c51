"""Groups of robots: their members, their common settings, and what cannot be a group."""

import pytest
from pydantic import TypeAdapter, ValidationError

from fleet.config.groups import Group, GroupConfig, check_groups, contradiction, members_of, said_by_groups
from fleet.robot_config import Limits

READ = TypeAdapter(Group)


def told(document):
    return [f"{each.line}: {str(each).partition(': ')[2]}" for each in document.problems]


def test_a_group_is_a_list_or_a_mapping_with_common_settings():
    assert members_of(READ.validate_python(["a", "b"])) == ("a", "b")
    group = READ.validate_python({"robots": ["a", "b"], "limits": {"speed": 2}})
    assert members_of(group) == ("a", "b")
    assert (group.limits, group.accepts) == (Limits(speed=2), None)
    assert READ.validate_python(group) == group
    assert isinstance(group, GroupConfig)


@pytest.mark.parametrize(
    "wrong", [5, "a", ["A"], {"robots": ["a"], "fence": {}}, {"limits": {}}, {"robots": 5}]
)
def test_what_is_no_group_is_refused(wrong):
    with pytest.raises(ValidationError):
        READ.validate_python(wrong)


def test_a_robot_has_the_settings_of_its_groups_in_the_order_of_the_file(reading):
    document = reading(
        "groups:\n"
        "  one: {robots: [a, b], limits: {speed: 1}, accepts: {command: [tele]}, other: 5}\n"
        "  two: [a]\n"
        "  three: {robots: [b], limits: {speed: 2}}\n"
        "  four: {robots: [b]}\n"
    )
    one = (("groups", "one"), {"limits": {"speed": 1}, "accepts": {"command": ["tele"]}})
    assert list(said_by_groups("a", document)) == [one]
    assert list(said_by_groups("b", document)) == [
        one,
        (("groups", "three"), {"limits": {"speed": 2}}),
        (("groups", "four"), {}),
    ]
    assert list(said_by_groups("c", document)) == []


@pytest.mark.parametrize(
    "text", ["groups: 5\n", "groups: [a]\n", "groups: {g: 5, h: {robots: a}}\n", "x: 1\n"]
)
def test_a_robot_has_no_settings_of_what_is_no_group(reading, text):
    assert list(said_by_groups("a", reading(text))) == []


@pytest.mark.parametrize(
    ("one", "other", "contradict"),
    [
        ({"speed": 1}, {"speed": 1}, False),
        ({"speed": 1}, {"speed": 1.0}, False),
        ({"speed": 1}, {"speed": 2}, True),
        ({"speed": 1}, {"altitude": 2}, False),
        ({"a": {"b": 1}}, {"a": {"c": 2}}, False),
        ({"a": {"b": 1, "c": 3}}, {"a": {"b": 1, "c": 4}}, True),
        (["tele", "sim"], ["sim", "tele"], False),
        (["tele"], ["tele", "tele"], True),
        (["tele"], ["sim"], True),
        ({}, {}, False),
        ({"a": 1}, 5, True),
        ([1], 1, True),
        ("x", "x", False),
        (None, 0, True),
    ],
)
def test_two_groups_contradict_each_other_where_they_give_one_field_two_values(one, other, contradict):
    assert contradiction(one, other) is contradict
    assert contradiction(other, one) is contradict


@pytest.mark.parametrize("form", ["{}", "{{robots: {}}}"])
def test_members_that_are_no_robots_or_stand_twice_are_reported_in_either_form(reading, form):
    document = reading(
        f"robots: [{{name: rex}}, {{name: kes}}]\ngroups:\n  yard: {form.format('[rex, rx, 5, rex]')}\n"
    )
    check_groups(document.data, document)
    at = "groups.yard.robots" if "robots" in form else "groups.yard"
    assert told(document) == [
        f"3: {at}[1]: there is no robot 'rx' (did you mean 'rex'?)",
        f"3: {at}[3]: 'rex' is in the group already",
    ]


def test_a_group_with_the_name_of_a_robot_is_reported_at_its_name(reading):
    document = reading("robots: [{name: rex}]\ngroups:\n  yard: [rex]\n  rex: []\n")
    check_groups(document.data, document)
    assert told(document) == ["4: groups.rex: a robot has this name too (rename the group)"]


@pytest.mark.parametrize(
    "text",
    [
        "groups: {g: [x]}\n",
        "robots: 5\ngroups: {g: [x]}\n",
        "robots: [{name: a}]\ngroups: 5\n",
        "robots: [5, {twin: x}, {name: a}]\ngroups: {g: 5, h: {robots: 5}, i: {}, j: [], k: [[a]]}\n",
    ],
)
def test_what_is_no_group_is_left_to_the_schema(reading, text):
    document = reading(text)
    check_groups(document.data, document)
    assert document.problems == []
