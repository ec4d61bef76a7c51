"""What is made from the code is as the code is."""

import html
import pathlib
import re
import subprocess
import sys

import pytest

from fleet.cli.main import COMMANDS
from fleet.cli.output import ExitCode

DOCS = pathlib.Path(__file__).parents[2] / "docs" / "reference"


@pytest.mark.parametrize(
    ("script", "result"),
    [
        ("make_config_reference.py", "config.md"),
        ("make_changes_reference.py", "../how-to/change-a-running-edge.md"),
        ("make_cli_reference.py", "cli.md"),
        ("make_mission_reference.py", "mission-grammar.md"),
        ("make_report_reference.py", "reports.md"),
        ("make_vehicle_reference.py", "vehicles.md"),
        ("make_screens.py", "screens.md"),
    ],
)
def test_a_reference_is_up_to_date(script, result):
    # In a process of its own: what other tests have loaded changes what there is to describe.
    program = f"import runpy, sys; sys.stdout.write(runpy.run_path({str(DOCS / script)!r})['render']())"
    made = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert (DOCS / result).read_text(encoding="utf-8") == made, f"run: python docs/reference/{script}"


def test_the_command_line_is_described_whole():
    text = (DOCS / "cli.md").read_text(encoding="utf-8")
    assert all(f"## fleet {name}\n" in text for name in COMMANDS)
    assert all(f"| {code.value} | " in text for code in ExitCode)


def test_every_picture_of_the_terminal_is_there_with_the_words_that_the_page_shows():
    page = (DOCS / "screens.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\((screens/[^)]+)\)", page)
    screens = re.findall(r"```\n\$ fleet ps\n(.*?)```", page, re.DOTALL)
    assert len(pictures) == len(screens) == 4
    for name, screen in zip(pictures, screens, strict=True):
        drawn = html.unescape(re.sub(r"<[^>]+>", "", (DOCS / name).read_text(encoding="utf-8")))
        assert set(screen.split()) <= set(drawn.split()), name
