"""Writes the tables of docs/how-to/change-a-running-edge.md from those of fleet.config.difference.

python docs/reference/make_changes_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import pathlib
from collections.abc import Mapping

from fleet.config.difference import FIELDS, LIVE_SECTIONS, SECTIONS

TARGET = pathlib.Path(__file__).parents[1] / "how-to" / "change-a-running-edge.md"
TABLES = {
    "Fields of a robot": ("field | why it needs a restart", FIELDS),
    "Sections of fleet.yaml": ("section | why it needs a restart", SECTIONS),
    "Sections that the running edge takes over": ("section | from when it counts", LIVE_SECTIONS),
}


def table(head: str, reasons: Mapping[str, str]) -> str:
    """Return a table of fields or sections."""
    rows = [f"| `{name}` | {why} |" for name, why in reasons.items()]
    return "\n".join((f"| {head} |", "|---|---|", *rows))


def render() -> str:
    """Return the page with the tables of now."""
    text = TARGET.read_text(encoding="utf-8")
    for title, (head, reasons) in TABLES.items():
        before, _, rest = text.partition(f"{title}:\n\n")
        text = f"{before}{title}:\n\n{table(head, reasons)}\n\n{rest.partition(chr(10) * 2)[2]}"
    return text


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
