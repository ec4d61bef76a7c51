"""``fleet doctor``: its report and its exit codes."""

import pytest

import fleet.cli.doctor as command
from fleet.doctor.finding import error, ok, warning


@pytest.mark.parametrize(
    ("findings", "code"),
    [
        ([ok("clock", "set")], 0),
        ([ok("clock", "set"), warning("disk", "small", "make room")], 0),
        ([error("devices", "gone", "plug it in")], 1),
        ([error("fleet file", "wrong", "correct it"), error("devices", "gone", "plug it in")], 3),
    ],
)
def test_an_error_has_an_exit_code_and_a_warning_has_none(fleet, monkeypatch, findings, code):
    monkeypatch.setattr(command, "examine", lambda *_, **__: findings)
    result = fleet("doctor", "--json")
    assert (result.code, result.json["ok"]) == (code, code == 0)
    assert result.json["findings"][0]["check"] == findings[0].check


def test_each_finding_says_what_to_do(fleet, monkeypatch):
    monkeypatch.setattr(command, "examine", lambda *_, **__: [error("devices", "gone", "plug it in")])
    result = fleet("doctor")
    assert result.out.splitlines() == ["error    devices: gone", "           plug it in"]
    assert "1 error, 0 warnings, 0 unknown, 0 ok" in result.err


def test_the_toy_fleet_is_looked_at(fleet, place, runtime, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(place / "var"))
    checks = {each["check"] for each in fleet("doctor", "--json").json["findings"]}
    assert {"clock", "disk", "permissions", "ports", "fleet file", "edges"} <= checks
