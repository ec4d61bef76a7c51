"""The running robots and edges as lines that fit a screen; pure.

The worst robots come first. Columns that do not fit are omitted as a whole, least important first, and so are
rows; a line names the omissions. Equal remarks about several robots become one line.
"""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from fleet.cli.output import GAP, counted
from fleet.config.text import printable
from fleet.health.causes import folded, without_name
from fleet.model.health import Level
from fleet.model.state import EdgeState, RobotState

WORTH_TELLING = 0.2  # s of clock offset or latency of a sender
NAMED = 3  # robots named in a folded remark
EDGES_SHOWN = 4  # on a screen; the others are counted
LONGEST = 3  # lines of a remark, or of an edge, on a screen
SHORTEST_CELL = 8  # columns of a truncated last column, at least
LEVELS = {level.word: level for level in Level}
_NUMBER = re.compile(r"(\d+)")


class Column(NamedTuple):
    """One column; the highest ``rank`` is omitted first; cells are truncated to ``most`` columns."""

    heading: str
    rank: int
    most: int
    cell: Callable[[RobotState], str]


def overview(
    states: Sequence[RobotState],
    edges: Sequence[EdgeState],
    *,
    width: int | None = None,
    height: int | None = None,
) -> list[str]:
    """Return the lines; ``width`` and ``height`` are those of the screen, None without a limit.

    One line of the height is left for the prompt.
    """
    ordered = sorted(states, key=_worst_first)
    names = names_of(ordered)
    head = [_cut(summary(ordered, edges), width)]
    foot = _edge_lines(edges, EDGES_SHOWN if height else None)
    foot = [part for line in foot for part in _wrapped(line, width, LONGEST if height else None)]
    table, left_out = _table(ordered, names, width, several=len({state.edge for state in states}) > 1)
    remark_lines = [_wrapped(line, width, LONGEST if height else None) for line in remarks(ordered, names)]
    if left_out:
        foot.append(_cut(f"not shown at this width: {', '.join(left_out)} (also in --json)", width))
    if height is None:
        return [*head, *table, *(part for lines in remark_lines for part in lines), *foot]
    room = height - 1 - len(head) - len(foot)
    lines = [*head, *(_cut(line, width) for line in _fitted(table, remark_lines, ordered, room)), *foot]
    return lines[: max(height - 1, 1)]


def _fitted(
    table: list[str], remark_lines: list[list[str]], states: Sequence[RobotState], room: int
) -> Iterator[str]:
    """Yield the part of a table and its remarks that fits ``room`` lines, and what is omitted."""
    needed = sum(map(len, remark_lines))
    if len(table) + needed <= room:
        yield from table
        yield from (part for lines in remark_lines for part in lines)
        return
    for_remarks = min(needed, max(room // 2, room - len(table)))
    rows = max(2, room - for_remarks - 1)
    yield from table[:rows]
    if len(table) > rows:
        yield _more(states[rows - 1 :])
        room -= 1
    room -= min(rows, len(table))
    for number, lines in enumerate(remark_lines):
        last = number == len(remark_lines) - 1
        if len(lines) > room - (0 if last else 1):
            yield f"and {counted(len(remark_lines) - number, 'more remark')}: fleet ps --all"
            return
        yield from lines
        room -= len(lines)


def _more(states: Sequence[RobotState]) -> str:
    """Describe the robots without a row."""
    return f"and {len(states)} more ({_by_health(states)}): fleet ps --all"


def summary(states: Sequence[RobotState], edges: Sequence[EdgeState]) -> str:
    """Return the number, health and kind (simulated, real) of the robots, on one line."""
    parts = [counted(len(states), "robot") + (f" on {len(edges)} edges" if len(edges) > 1 else "")]
    if states:
        stopped = sum(state.emergency_stop for state in states)
        simulated = sum(state.simulated for state in states)
        parts.append(_by_health(states) + (f"; {stopped} with an emergency stop set" if stopped else ""))
        parts[1] += {0: "; all real", len(states): "; all simulated"}.get(
            simulated, f"; {simulated} simulated, {len(states) - simulated} real"
        )
    return ": ".join(parts)


def _by_health(states: Iterable[RobotState]) -> str:
    """Return the number of robots by health, worst first."""
    found = Counter(state.health for state in states)
    return ", ".join(f"{found[word]} {word}" for word in sorted(found, key=_level, reverse=True))


def names_of(states: Sequence[RobotState]) -> list[str]:
    """Return the name of each robot for commands, with its edge if several have the same name."""
    found = Counter(state.name for state in states)
    return [state.name if found[state.name] == 1 else f"{state.edge}/{state.name}" for state in states]


def _worst_first(state: RobotState) -> tuple[object, ...]:
    """Sort key: by health, then by name, with numbers in natural order."""
    parts = _NUMBER.split(state.name)
    natural = tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts)
    return -_level(state.health), not state.emergency_stop, natural, state.edge


def _level(word: str) -> int:
    """Return the severity of a health; an unknown word counts as a fault."""
    return LEVELS.get(word, Level.FAULT)


# -- table ---------------------------------------------------------------------------------------------


def _table(
    states: Sequence[RobotState], names: Sequence[str], width: int | None, *, several: bool
) -> tuple[list[str], list[str]]:
    """Return the lines of the table, and the headings of the omitted columns."""
    if not states:
        return [], []
    placed = any(state.site is not None for state in states)
    columns = [
        Column("edge", 8, 16, lambda state: state.edge),
        Column("kind", 9, 10, lambda state: state.adapter or "-"),
        Column("sim", 2, 4, lambda state: "sim" if state.simulated else "real"),
        Column("health", 1, 8, lambda state: state.health),
        Column("mode", 5, 18, mode_of),
        Column("bat%", 4, 4, lambda state: "-" if state.battery is None else f"{state.battery:.0f}"),
        Column("site" if placed else "position", 3, 24, lambda state: place_of(state, placed=placed)),
        Column("m/s", 6, 5, speed_of),
        Column("age", 7, 6, age_of),
        Column("doing", 3, 24, lambda state: state.activity or "-"),
        Column("last command", 10, 60, last_of),
    ]
    cells = [("robot", 0, 24, list(names))]
    cells += [
        (one.heading, one.rank, one.most, [one.cell(state) for state in states])
        for one in columns
        if several or one.heading != "edge"
    ]
    shown = [
        (heading, rank, _sized(heading, column, most if width else None))
        for heading, rank, most, column in cells
    ]
    left_out: list[str] = []
    while width and len(shown) > 2 and _least(shown) > width:
        worst = max(shown, key=lambda column: column[1])
        shown.remove(worst)
        left_out.append(worst[0])
    rows = zip(*(column for _, _, column in shown), strict=True)
    return [_cut(GAP.join(row).rstrip(), width) for row in rows], left_out


def _sized(heading: str, cells: Sequence[str], most: int | None) -> list[str]:
    """Return a column as cells of one width, with the heading first."""
    made = [heading.upper(), *(_cut(printable(cell), most) for cell in cells)]
    size = max(map(len, made))
    return [cell.ljust(size) for cell in made]


def _least(shown: Sequence[tuple[str, int, list[str]]]) -> int:
    """Return the minimal width of a table, whose last column may be truncated."""
    sizes = [len(column[0]) for _, _, column in shown]
    last = min(sizes[-1], max(SHORTEST_CELL, len(shown[-1][0])))
    return sum(sizes[:-1]) + last + len(GAP) * (len(sizes) - 1)


def _cut(text: str, width: int | None) -> str:
    """Return text truncated to ``width`` columns."""
    return text if width is None or len(text) <= width else f"{text[: max(width - 1, 0)]}…"


def _wrapped(text: str, width: int | None, most: int | None) -> list[str]:
    """Return text broken between words into at most ``most`` lines, continuation lines indented."""
    text = printable(text)
    if width is None or len(text) <= width:
        return [text]
    columns = max(width, len(GAP) + 1)
    return textwrap.wrap(
        text, columns, subsequent_indent=GAP, break_on_hyphens=False, max_lines=most, placeholder="…"
    )


def place_of(state: RobotState, *, placed: bool = True) -> str:
    """Return the position of a robot in metres in the site's frame, else in its own frame (``own``).

    ``placed``: some robots in the same view are in the site's frame.
    """
    if state.site is not None:
        at, frame = state.site, ""
    elif state.position is not None:
        at, frame = state.position, " own" * placed
    else:
        return "-"
    return f"{at.x:.1f} {at.y:.1f} {at.z:.1f}{frame}"


def speed_of(state: RobotState) -> str:
    """Return the speed of a robot, m/s."""
    return "-" if state.speed is None else f"{state.speed:.1f}"


def age_of(state: RobotState) -> str:
    """Return the time since the last report of a robot."""
    return "-" if state.age is None else duration(state.age)


def duration(seconds: float) -> str:
    """Return a time in the largest unit of which it has at least one."""
    sizes = ((86_400, "d"), (3600, "h"), (60, "min"))
    size, unit = next(((size, unit) for size, unit in sizes if seconds >= size), (1, "s"))
    return f"{max(seconds, 0.0) / size:.0f} {unit}"


def last_of(state: RobotState) -> str:
    """Return the last command with its outcome."""
    return f"{state.last_command}: {state.last_outcome}" if state.last_command else "-"


def mode_of(state: RobotState) -> str:
    """Return mode and arming as a word or two."""
    armed = {True: " armed", False: "", None: ""}[state.armed]
    return f"{state.mode or '-'}{armed}"


def battery_of(state: RobotState) -> str:
    """Return the battery in percent."""
    return "-" if state.battery is None else f"{state.battery:.0f} %"


# -- remarks -------------------------------------------------------------------------------------------


def remarks(states: Sequence[RobotState], names: Sequence[str]) -> list[str]:
    """Return the remarks about robots, equal ones once, in order of the first.

    Remarks are equal if they differ only in measured figures or in the robot's own name.
    """
    groups: dict[str, list[tuple[str, str, str]]] = {}
    for name, state in zip(names, states, strict=True):
        for text in _remarks(state):
            common = without_name(text, state.name)
            groups.setdefault(folded(common), []).append((name, text, common))
    return [
        f"{_listed([name for name, _, _ in same])}: {same[0][1] if len(same) == 1 else same[0][2]}"
        for same in groups.values()
    ]


def _remarks(state: RobotState) -> Iterator[str]:
    """Yield the remarks about one robot."""
    if state.cause:
        yield state.cause
    for sender, offset in state.senders.items():
        if abs(offset) > WORTH_TELLING:
            yield f"the clock of {sender} is {offset:.2f} s behind, or the network delays it as much"
    if state.drop_in and not state.worker:
        yield f"{state.drop_in} runs in the edge's own process (worker: main)"
    if state.separation:
        yield f"separation {state.separation}"


def _listed(names: Sequence[str]) -> str:
    """Return some names, and the number of the others."""
    more = len(names) - NAMED
    if more <= 0:
        return ", ".join(names)
    return f"{', '.join(names[:NAMED])} and {more} more"


def _edge_lines(edges: Sequence[EdgeState], most: int | None) -> list[str]:
    """Return the lines of the edges, worst first, at most ``most``."""
    ordered = sorted(edges, key=lambda edge: (-_level(edge.health), edge.edge))
    if most is None or len(ordered) <= most:
        return [edge_line(edge) for edge in ordered]
    rest = Counter(edge.health for edge in ordered[most:])
    more = ", ".join(f"{number} {word}" for word, number in rest.items())
    return [*map(edge_line, ordered[:most]), f"and {len(ordered) - most} more edges ({more}): fleet ps --all"]


def edge_line(edge: EdgeState) -> str:
    """Return an edge on one line."""
    robots = ", ".join(f"{number} {word}" for word, number in edge.robots.items()) or "no robots"
    cause = f" ({edge.cause})" if edge.cause else ""
    return (
        f"edge {edge.edge}: {edge.health}{cause}; {robots}; cloud {edge.cloud}{cloud_line(edge)}; "
        f"up {duration(edge.uptime)}"
    )


def cloud_line(edge: EdgeState) -> str:
    """Return the latency of the cloud, and the numbers of waiting, dropped and refused messages, if any.

    Waiting states are no backlog, because newer ones replace them; neither are messages without a subscriber
    in the cloud.
    """
    waiting = max(0, edge.spooled - edge.unheard)
    parts = [
        (edge.round_trip, f"{(edge.round_trip or 0) * 1000:.0f} ms away"),
        (waiting, f"{counted(waiting, 'message')} not sent yet"),
        (edge.unheard, f"{counted(edge.unheard, 'message')} kept until they have a subscriber"),
        (edge.dropped, f"{edge.dropped} dropped"),
        (edge.refused, f"{edge.refused} refused"),
    ]
    said = ", ".join(words for value, words in parts if value)
    return f" ({said})" if said else ""
