"""What an emergency stop lets through is said for each kind of robot, in its guide and in the help."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from fleet.cli.send import send
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_quadruped.adapter import QuadrupedAdapter
from fleet_ugv.adapter import UgvAdapter

DOCS = Path(__file__).parents[2] / "docs" / "how-to"
NOTHING = {
    "ugv.md": "nothing that moves the robot is obeyed",
    "quadruped.md": "nothing that moves the dog is obeyed",
}


def let_through(adapter):
    """Return the commands that may move a robot during an emergency stop."""
    return {name for name, spec in adapter.commands().items() if spec.safe and spec.moves}


@pytest.mark.parametrize(
    ("adapter", "guide"),
    [(MavlinkAdapter, "mavlink.md"), (UgvAdapter, "ugv.md"), (QuadrupedAdapter, "quadruped.md")],
)
def test_the_guide_says_what_still_moves_it(adapter, guide):
    text = (DOCS / guide).read_text(encoding="utf-8")
    moving = let_through(adapter)
    if not moving:
        assert NOTHING[guide] in text
        return
    (line,) = [line for line in text.splitlines() if line.startswith("* While an emergency stop is set")]
    assert {name for name in adapter.commands() if f"`{name}`" in line} >= moving


def test_the_help_says_what_a_drone_still_obeys():
    text = CliRunner().invoke(send, ["--help"]).output
    assert all(name in text for name in let_through(MavlinkAdapter))
    assert not let_through(UgvAdapter)
    assert not let_through(QuadrupedAdapter)
