import pytest

PAIR = "pair: [a, b]\nlease: {servers: ['tls://lease.example.com:4222']}"


def test_a_good_file_is_reported_in_one_line(fleet):
    result = fleet("check")
    assert result == (0, "fleet.yaml is valid: edge yard-1, 1 robot (1 toy), 0 groups, no cloud\n", "")


def test_a_good_file_is_reported_to_programs(fleet):
    assert fleet("check", "--json").json == {
        "ok": True,
        "file": "fleet.yaml",
        "edge": "yard-1",
        "robots": [
            {
                "name": "rex",
                "twin": "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11",
                "adapter": "toy",
                "simulated": True,
            }
        ],
        "groups": {},
        "cloud": None,
        "problems": [],
        "warnings": [],
    }


def test_when_the_standby_of_a_pair_moves_a_robot_is_shown(fleet, place):
    text = (place / "fleet.yaml").read_text().replace("edge: {id: yard-1}", PAIR)
    (place / "fleet.yaml").write_text(
        text.replace("link: sim:toy", "link: tcp:10.0.0.7:5760\n    worker: main")
    )
    code, said, _ = fleet("check")
    assert code == 0
    assert "after an operator has stopped it from there" in said
    assert fleet("check", "--json").json["moved_after"] == {"rex": None}


def test_problems_go_to_stderr_with_line_and_caret(fleet, place):
    text = (place / "fleet.yaml").read_text()
    (place / "fleet.yaml").write_text(text.replace("link:", "lnik:"))
    assert fleet("check") == (
        3,
        "",
        (
            "fleet.yaml:7:5: robots[0].lnik: unknown key\n"
            "    lnik: sim:toy\n"
            "    ^\n"
            "    did you mean 'link'?\n"
            "fleet: 1 problem\n"
        ),
    )


def test_problems_are_reported_to_programs(fleet, place):
    (place / "other.yaml").write_text("edge: {id: e}\nrobots: 1\n")
    result = fleet("check", "other.yaml", "--json")
    assert (result.code, result.err) == (3, "")
    assert result.json == {
        "ok": False,
        "file": "other.yaml",
        "problems": [
            {
                "file": "other.yaml",
                "line": 2,
                "column": 9,
                "path": "robots",
                "message": "must be a list",
                "text": "robots: 1",
                "hint": "- {name: ..., twin: ..., adapter: ...}",
            }
        ],
    }


def test_a_file_that_is_not_there_is_an_invalid_configuration(fleet):
    result = fleet("check", "none.yaml")
    assert result.code == 3
    assert result.err.startswith("none.yaml:1:1: cannot read none.yaml: No such file or directory\n")


def test_nothing_in_a_file_can_steer_the_terminal(fleet, place):
    (place / "fleet.yaml").write_text('"\\e[2J\\x9b": 1\nedge: {id: "\\e]0;x\\a"}\n')
    result = fleet("check")
    assert result.err.replace("\n", "").isprintable()


def test_a_battery_policy_whose_way_home_ends_below_the_reserve_is_warned_of(fleet, place):
    text = (place / "fleet.yaml").read_text()
    (place / "fleet.yaml").write_text(text + "    battery_policy: {reserve: 25, low: 20}\n")
    result = fleet("check")
    assert result.code == 0
    assert "low (20 %) is below reserve (25 %)" in result.err
    (warning,) = fleet("check", "--json").json["warnings"]
    assert (warning["path"], warning["line"]) == ("robots[0].battery_policy.low", 8)


def test_a_warning_stands_at_the_policy_when_the_default_is_what_is_too_small(fleet, place):
    text = (place / "fleet.yaml").read_text()
    (place / "fleet.yaml").write_text(text + "    battery_policy: {reserve: 30}\n")
    (warning,) = fleet("check", "--json").json["warnings"]
    assert warning["path"] == "robots[0].battery_policy"


TWO = """
edge: {{id: yard-1}}
{site}
robots:
  - {{name: rex, twin: 6f0c9a1e-0000-4000-8000-000000000001, adapter: mavlink, link: "sim:px4"}}
  - name: max
    twin: 6f0c9a1e-0000-4000-8000-000000000002
    adapter: ugv
    profile: waveshare-beast
    link: "serial:/dev/ttyUSB0?baud=115200"
    {start}
"""
SITE, START = "site: {origin: [47.4, 8.5, 400.0]}", "start: [5, 0, 0]"


PARTNER = """
edge: {id: yard-1}
partners: {barn-1: {robots: [own]}}
robots:
  - {name: max, twin: 6f0c9a1e-0000-4000-8000-000000000002, adapter: ugv, profile: waveshare-beast,
     link: "serial:/dev/ttyUSB0?baud=115200", start: [5, 0, 0]}
"""


def test_one_robot_beside_those_of_a_partner_is_warned_of_too(fleet, place):
    (place / "fleet.yaml").write_text(PARTNER)
    (warning,) = fleet("check", "--json").json["warnings"]
    assert "position of its start on Earth is unknown" in warning["message"]


@pytest.mark.parametrize(
    ("site", "start", "expected", "hint"),
    [
        (SITE, "", "it cannot be placed beside the others", "start: [metres east"),
        ("", START, "position of its start on Earth is unknown", "site: {origin:"),
        (SITE, START, "", ""),
    ],
)
def test_a_robot_that_cannot_be_placed_beside_the_others_is_warned_of(  # noqa: PLR0917
    fleet, place, site, start, expected, hint
):
    (place / "fleet.yaml").write_text(TWO.format(site=site, start=start))
    result = fleet("check", "--json")
    assert result.code == 0, result.json
    warnings = result.json["warnings"]
    assert len(warnings) == bool(expected)
    for warning in warnings:
        assert expected in warning["message"]
        assert warning["hint"].startswith(hint)
        assert warning["path"].startswith("robots[1]")


def test_many_robots_that_cannot_be_placed_are_warned_of_together(fleet, place):
    robots = "".join(
        f"  - {{name: r{number}, twin: 6f0c9a1e-0000-4000-8000-0000000000{number:02}, adapter: ugv, "
        f'profile: waveshare-beast, link: "serial:/dev/ttyUSB{number}?baud=115200"}}\n'
        for number in range(20)
    )
    (place / "fleet.yaml").write_text(f"edge: {{id: yard-1}}\nrobots:\n{robots}")
    (warning,) = fleet("check", "--json").json["warnings"]
    assert warning["message"].startswith("it and 19 other robots cannot be placed")
