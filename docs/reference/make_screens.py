"""Write docs/reference/screens.md and its pictures: ``fleet ps`` with 1, 10 and 40 robots on two terminals.

python docs/reference/make_screens.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import io
import pathlib
from collections import Counter

from rich.console import Console
from rich.text import Text

from fleet.cli.output import COLORS
from fleet.cli.overview import overview
from fleet.model.geometry import Vector3
from fleet.model.state import EdgeState, RobotState

TARGET = pathlib.Path(__file__).with_name("screens.md")
PICTURES = pathlib.Path(__file__).with_name("screens")
SHOWN = ((1, 80, 24), (10, 80, 24), (40, 80, 24), (40, 120, 40))  # robots, columns, lines
KINDS = (("drone", "mavlink", "AUTO.LOITER"), ("ugv", "ugv", ""), ("dog", "quadruped", ""))
TROUBLES = {
    5: ("offline", "no heartbeat for 4 s"),
    9: ("degraded", "no satellite fix (4 satellites)"),
    17: (
        "fault",
        "the drive FL_knee told 0x7310: over-temperature; look at it, then: fleet send dog-6 reset",
    ),
}
INTRODUCTION = """\
# What the terminal shows

Made by `docs/reference/make_screens.py`; do not edit.

`fleet ps`, `fleet ps --watch`, `fleet run` and `fleet demo` show one picture, which fits its screen: the
worst robots first, the rest counted, equal causes in one line. `fleet ps --all` shows every robot.
"""


def robot(number: int) -> RobotState:
    """Return one robot of a site that is busy."""
    name, adapter, mode = KINDS[(number - 1) % 3]
    health, cause = TROUBLES.get(number % 20, ("ok", ""))
    return RobotState(
        f"{name}-{(number + 2) // 3}",
        "",
        adapter,
        "yard-1",
        0.0,
        health=health,
        cause=cause,
        reachable=health != "offline",
        simulated=number % 2 == 0,
        mode=mode,
        armed=number % 6 == 1 if mode else None,
        battery=100.0 - 2 * number,
        site=Vector3(3.0 * number, -1.5 * number, 5.0 if mode else 0.0),
        speed=0.0 if health != "ok" else 0.1 * (number % 5),
        age=4.0 if health == "offline" else 0.2,
        activity="goto" if number % 5 else "",
        last_command="goto" if number % 5 else "",
        last_outcome="under way" if number % 5 else "",
    )


def screen(robots: int, columns: int, lines: int) -> list[str]:
    """Return the lines of one picture."""
    states = [robot(number) for number in range(1, robots + 1)]
    counts = Counter(state.health for state in states)
    edge = EdgeState(
        "yard-1", "", 0.0, 7260.0, cloud="connected", round_trip=0.042, robots=dict(sorted(counts.items()))
    )
    return overview(states, [edge], width=columns, height=lines)


def render() -> str:
    """Return the page."""
    parts = [INTRODUCTION]
    for robots, columns, lines in SHOWN:
        text = "\n".join(screen(robots, columns, lines))
        title = f"{robots} robot{'s' * (robots > 1)}, {columns} x {lines}"
        parts.append(
            f"\n## {title}\n\n![{title}](screens/{_name(robots, columns)})\n\n```\n$ fleet ps\n{text}\n```\n"
        )
    return "".join(parts)


def picture(robots: int, columns: int, lines: int) -> str:
    """Return one picture as SVG."""
    console = Console(record=True, width=columns, file=io.StringIO(), force_terminal=True)
    text = Text("\n".join(screen(robots, columns, lines)), no_wrap=True)
    for word, color in COLORS.items():
        text.highlight_regex(rf"(?<!\S){word}(?!\S)", color)
    console.print(Text("$ fleet ps"), text, sep="\n")
    return console.export_svg(title="fleet ps", unique_id=f"ps-{robots}-{columns}")


def _name(robots: int, columns: int) -> str:
    """Return the name of a picture's file."""
    return f"ps-{robots}-{columns}.svg"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
    for shown in SHOWN:
        (PICTURES / _name(*shown[:2])).write_text(picture(*shown), encoding="utf-8")
