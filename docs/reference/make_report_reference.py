"""Writes docs/reference/reports.md from the reports of fleet.model.report; run it after changing one.

python docs/reference/make_report_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import inspect
import pathlib
import typing

import msgspec

from fleet.model.report import JointTags, Report

TARGET = pathlib.Path(__file__).with_name("reports.md")
INTRODUCTION = """\
# Reports

What an adapter may report, by `robot.report(...)` or from `decode`. All are exported by `fleet`. Made from
the types by `docs/reference/make_report_reference.py`; do not edit. Frames: body x forward, y left, z up;
world east-north-up. `stamp` is the time of the measurement, Unix seconds (`robot.clock.time()`). Where each
goes: [topics](topics.md).
"""


def _summary(kind: type) -> str:
    """Return the docstring of a report as one paragraph."""
    return " ".join(inspect.getdoc(kind).replace("``", "`").split())  # type: ignore[union-attr]


def _fields(kind: type) -> list[str]:
    """Return a row for each field: name, type, default."""
    rows = ["| field | type | default |", "|---|---|---|"]
    for field in msgspec.structs.fields(kind):
        declared = kind.__annotations__[field.name]
        said = declared if isinstance(declared, str) else inspect.formatannotation(declared)
        default = "**required**" if field.required else ""
        rows.append(f"| `{field.name}` | `{said}` | {default} |".replace(" | None`", "`, or nothing"))
    return rows


def render() -> str:
    """Return the whole reference."""
    lines = [INTRODUCTION.rstrip()]
    for kind in (*typing.get_args(Report), JointTags):
        lines += ["", f"## {kind.__name__}", "", _summary(kind), "", *_fields(kind)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
