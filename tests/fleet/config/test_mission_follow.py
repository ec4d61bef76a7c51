"""Who follows whom in a step is checked before anything moves, with its place."""

import pytest

from fleet.config.missions import KnownNames, read_mission
from fleet.config.problems import InvalidConfig

MISSION = """\
version: 1
roles: {eye: {}, feet: {}, many: {count: 3}}
steps:
  - id: go
    do: {feet: {goto: [1, 2]}, eye: {follow: feet, distance: 4}}
"""
DO = "{feet: {goto: [1, 2]}, eye: {follow: feet, distance: 4}}"


def read(tmp_path, do=DO):
    (tmp_path / "m.yaml").write_text(MISSION.replace(DO, do))
    return read_mission(tmp_path / "m.yaml", {}, KnownNames()).program({}).steps[0]


def test_who_follows_goes_on_for_as_long_as_the_others_do(tmp_path):
    (act,) = read(tmp_path).acts["eye"]
    assert (act.verb, act.value, act.data, act.timeout) == ("follow", "feet", {"distance_m": 4.0}, 86_400.0)


def test_one_may_follow_one_that_follows_another(tmp_path):
    assert read(tmp_path, "{feet: {goto: [1, 2]}, eye: {follow: feet}, many: {follow: eye}}")
    assert read(tmp_path, "{feet: {goto: [1, 2]}, all: {follow: feet}}")


@pytest.mark.parametrize(
    ("do", "column", "why"),
    [
        ("{feet: {goto: [1, 2]}, eye: {follow: foot}}", 46, "there is no role 'foot'"),
        ("{feet: {goto: [1, 2]}, eye: {follow: all}}", 46, "all is every robot"),
        ("{many: {goto: [1, 2]}, eye: {follow: many}}", 46, "role many may have 3 robots"),
        ("{eye: {follow: feet}}", 24, "feet does nothing in this step"),
        ("{eye: {follow: feet}, feet: {follow: eye}}", 24, "no robot leads: eye > feet > eye"),
        ("{eye: {follow: eye}}", 24, "no robot leads: eye > eye"),
        ("{all: {follow: feet}}", 24, "no robot leads: all > feet > feet"),
        ("{feet: {goto: [1, 2]}, eye: {follow: feet}}\n    finish: eye", 13, "eye follows, and is never"),
        ("{feet: {goto: [1, 2]}}\n    undo: {eye: {follow: feet}}", 26, "to follow undoes nothing"),
        ("{feet: {goto: [1, 2]}, eye: {follow: feet, timeout: 5 s}}", 52, "they have timeouts"),
        ("{feet: {goto: [1, 2], distance: 3}}", 31, "is allowed only with follow"),
        ("{feet: {goto: [1, 2]}, eye: {follow: feet, retry: 1}}", 52, "is not known to bear it"),
    ],
)
def test_what_could_not_end_is_reported_with_its_place(tmp_path, do, column, why):
    with pytest.raises(InvalidConfig) as caught:
        read(tmp_path, do)
    problem = caught.value.problems[0]
    assert why in problem.message
    assert problem.line in (5, 6)
    assert problem.column == column
