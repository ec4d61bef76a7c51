import os
import subprocess
import sys

import msgspec
import pytest

from fleet.bus import keys
from fleet.cli.completion import SHELLS
from fleet.model.description import CommandDescription, RobotDescription
from fleet.model.place import Place

DOCK = Place("dock-1", (1.0, 2.0))


@pytest.fixture
def complete(place, play_edge):
    """Complete a line as bash would, with an edge that runs."""
    edge = play_edge(
        "yard-1", robots={"kestrel": {}, "rex": {}}, groups={"kites": ["kestrel"]}, places={"dock-1": DOCK}
    )
    found = RobotDescription("kestrel", "toy", (CommandDescription("takeoff"), CommandDescription("land")))

    def tell(question):
        question.reply(msgspec.json.encode(found))
        question.close()

    edge.bus.control.declare_queryable(keys.description("yard-1", "kestrel"), tell)

    def complete(line):
        words = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)}
        environ = os.environ | words | {"_FLEET_COMPLETE": "bash_complete"}
        program = [sys.executable, "-m", "fleet"]
        done = subprocess.run(program, check=True, capture_output=True, text=True, env=environ, timeout=60)
        return [line.partition(",")[2] for line in done.stdout.split()]

    return complete


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_a_script_that_asks_the_program(fleet, shell):
    result = fleet("completion", shell)
    assert (result.code, result.err) == (0, "")
    assert "_FLEET_COMPLETE" in result.out


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("fleet desc", ["describe"]),
        ("fleet send k", ["kestrel", "kites"]),
        ("fleet goto r", ["rex"]),
        ("fleet send kestrel ta", ["takeoff"]),
        ("fleet describe kestrel ", ["land", "takeoff"]),
        ("fleet send nobody ", []),
        ("fleet goto rex d", ["dock-1"]),
    ],
)
def test_robots_groups_commands_and_places_are_completed(complete, line, said):
    assert complete(line) == said
