"""Missions within missions are checked before anything moves: each problem with its place."""

import pytest

from fleet.config.load import load
from fleet.config.missions import KnownNames, mission_of, read_mission
from fleet.config.problems import InvalidConfig

FLEET = """\
edge: {id: yard-1}
robots:
  - {name: beast, twin: 6f0c9a1e-1111-4111-8111-000000000001, adapter: ugv, profile: waveshare-beast, link: "sim:waveshare-beast"}
missions:
  patrol:
    version: 1
    inputs: {speed: {type: number, default: 1}}
    roles: {feet: {}}
    steps:
      - {id: a, wait: 1 s}
      - id: round
        repeat: {times: 2, steps: [{id: look, do: {feet: {mission: scan, with: {height: 3, name: {input: speed}}}}}]}
    on_abort: hold
  scan:
    version: 1
    inputs: {height: {type: number, max: 9}, name: {type: number, default: 1}}
    roles: {any: {}}
    steps:
      - {id: go, do: {any: {goto: [1, 1]}}}
"""  # noqa: E501
SCAN = "mission: scan, with: {height: 3, name: {input: speed}}"


@pytest.fixture
def problems(tmp_path):
    """Load FLEET with one text in the place of another; gives its problems."""

    def problems(instead="", of=""):
        assert of in FLEET
        (tmp_path / "fleet.yaml").write_text(FLEET.replace(of, instead, 1) if of else FLEET)
        try:
            load(tmp_path / "fleet.yaml", {})
        except InvalidConfig as error:
            return [(each.line, each.message, each.column) for each in error.problems]
        return []

    return problems


def test_a_mission_may_carry_out_another(problems):
    assert problems() == []


@pytest.mark.parametrize(
    ("instead", "of", "line", "message"),
    [
        ("mission: scam", SCAN, 12, "there is no mission 'scam'"),
        ("mission: patrol", SCAN, 12, "a mission within itself: patrol > patrol"),
        (
            "any: {mission: patrol}",
            "any: {goto: [1, 1]}",
            12,
            "a mission within itself: patrol > scan > patrol",
        ),
        (
            "any: {mission: patrol}",
            "any: {goto: [1, 1]}",
            19,
            "a mission within itself: scan > patrol > scan",
        ),
        ("mission: scan", SCAN, 12, "scan needs height"),
        ("mission: scan, with: {height: 3, hight: 1}", SCAN, 12, "scan has no input 'hight'"),
        ("mission: scan, with: {height: 10}", SCAN, 12, "must be at most 9"),
        ("{any: {count: 2}}", "{any: {}}", 12, "scan needs 2 robots, feet has at most 1"),
        ("- {id: go, extra: 1,", "- {id: go,", 19, "unknown key"),
        (
            "    on_failure: stop\n    version: 1\n    inputs: {height",
            "    version: 1\n    inputs: {height",
            12,
            "scan says on_failure: stop, patrol on_failure: hold, and a run has one end",
        ),
        (
            "    rehearse: required\n    version: 1\n    inputs: {height",
            "    version: 1\n    inputs: {height",
            12,
            "scan must be rehearsed",
        ),
        ("mission: scan, timeout: 3 s, with: {height: 3}", SCAN, 12, "a mission has a deadline of its own"),
        (
            "look, start: together,",
            "look,",
            12,
            "is allowed only in the steps of the mission that this step carries",
        ),
        ("feet: land, all: {mission", "feet: {mission", 12, "a mission is alone in its step"),
    ],
)
def test_each_problem_is_reported_with_its_place(problems, instead, of, line, message):
    found = problems(instead, of)
    assert any((at, message in words) == (line, True) for at, words, _ in found), found
    assert all(column > 1 for _, _, column in found)


def test_a_file_within_itself_is_found_though_the_fleet_is_not_known(tmp_path):
    text = "version: 1\nroles: {a: {}}\nsteps: [{id: x, do: {a: {mission: patrol}}}]\n"
    (tmp_path / "patrol.yaml").write_text(text)
    with pytest.raises(InvalidConfig, match=r"patrol.yaml:3:\d+: .*a mission within itself: patrol > patrol"):
        read_mission(tmp_path / "patrol.yaml", {}, KnownNames())


def test_a_mission_that_is_sent_is_checked_against_those_of_the_edge():
    data = {"version": 1, "roles": {"a": {}}, "steps": [{"id": "x", "do": {"a": {"mission": "scan"}}}]}
    with pytest.raises(InvalidConfig, match="there is no mission 'scan'"):
        mission_of("patrol", data, {})
