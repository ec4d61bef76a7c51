"""Access of an agent to the edge on its computer; tests/system/test_rollout.py checks that it applies."""

import pytest

from fleet.model.change import Change, ChangeKind, Outcome
from fleet.rollout.bundle import BundleError
from fleet.rollout.edge_here import ApplyResult, Code, LocalEdge, summary

FILE = "edge: {{id: {id}}}\nplugins: [plugins]\nrobots: !include robots.yaml\n"
ROBOTS = '- {{name: rex, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: bot, link: "{link}"}}\n'
CODE = """
from typing import Literal
from fleet import AdapterConfig, FrameAdapter

class BotConfig(AdapterConfig):
    adapter: Literal["bot"]
    link: str

class Bot(FrameAdapter[BotConfig]):
    Config = BotConfig

    def drive(self, velocity):
        return ()

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return (b"halt",)
"""


def folder_of(place, *, edge="yard-1", link="tcp:10.0.0.1:1", code=CODE, body="legs: 4\n"):
    for name, text in {
        "fleet.yaml": FILE.format(id=edge),
        "robots.yaml": ROBOTS.format(link=link),
        "plugins/bot.py": code,
        "bodies/rex.yaml": body,
    }.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text)
    return place


@pytest.fixture
def here(tmp_path):
    return LocalEdge("yard-1", tmp_path / "current" / "fleet.yaml")


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({}, Code()),
        ({"link": "tcp:10.0.0.2:1"}, Code()),
        ({"code": CODE + "\n"}, Code(("bot",))),
        ({"body": "legs: 6\n"}, Code((), ("bodies/rex.yaml",))),
    ],
)
def test_changes_outside_the_fleet_file_are_listed(here, tmp_path, changes, code):
    before = folder_of(tmp_path / "a")
    assert here.check(folder_of(tmp_path / "b", **changes), before) == code


def test_the_file_of_another_edge_is_refused(here, tmp_path):
    with pytest.raises(BundleError, match="for edge yard-2, not yard-1"):
        here.check(folder_of(tmp_path / "b", edge="yard-2"), None)


def test_an_edge_that_does_not_run_gets_the_bundle_at_its_start(here, tmp_path, monkeypatch):
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(tmp_path / "runtime"))
    folder_of(tmp_path / "current")
    assert here.running() is None
    assert here.apply("alice") == ApplyResult(waits="edge yard-1 does not run; it starts with this bundle")
    assert here.reload("bot") == ""


def test_changes_are_summed_up_with_one_line_each():
    done = Change("rex", ChangeKind.SETTINGS, outcome=Outcome.DONE)
    waits = Change("max", ChangeKind.REBUILT, why="it is armed", outcome=Outcome.REFUSED)
    failed = Change("ada", ChangeKind.REBUILT, why="no answer", outcome=Outcome.FAILED)
    same = Change("bob", ChangeKind.UNTOUCHED)
    assert summary([done, same]) == ApplyResult(("rex: settings only: done",))
    assert summary([done, waits, failed]) == ApplyResult(
        ("rex: settings only: done", "max: rebuilt: refused", "ada: rebuilt: failed"),
        failed="ada: no answer",
        waits="max: it is armed",
    )
