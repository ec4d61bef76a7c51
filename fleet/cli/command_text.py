"""Declared commands as text: usage, and parameters with type, range, unit and default."""

from __future__ import annotations

import math

from fleet.cli.output import Output
from fleet.commands import Range
from fleet.model.description import CommandDescription, ParameterDescription


def parameters(one: CommandDescription) -> str:
    """Return the usage of a command's parameters."""
    return " ".join(map(usage, one.parameters)) or "-"


def usage(each: ParameterDescription) -> str:
    """Return the usage of a parameter, in brackets if it is optional."""
    text = f"{each.name}={each.type.upper().replace(' ', '-')}"
    return text if each.required else f"[{text}]"


def show(out: Output, one: CommandDescription) -> None:
    """Show help, parameters and properties of one command."""
    if one.summary:
        out.say(one.summary)
    if one.parameters:
        rows = [(each.name, each.type, _range(each), _default(each)) for each in one.parameters]
        out.table(("parameter", "type", "range", "default"), rows)
    traits = [
        "may move the robot" if one.moves else "does not move the robot",
        "taken during an emergency stop" if one.safe else "",
        f"given up after {one.timeout:g} s" if one.timeout else "",
    ]
    out.say("; ".join(filter(None, traits)))


def _range(each: ParameterDescription) -> str:
    """Return the range of a parameter with its unit."""
    if each.least is None and each.most is None:
        return each.unit or "-"
    least = -math.inf if each.least is None else each.least
    most = math.inf if each.most is None else each.most
    return str(Range(least, most, each.unit))


def _default(each: ParameterDescription) -> str:
    """Return the default of a parameter."""
    return "(must be given)" if each.required else each.default or "-"
