"""Declaring commands: ``@command`` on a method, its parameters checked by its own signature."""

from __future__ import annotations

import difflib
import inspect
import math
import re
import typing
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar

import msgspec

from fleet.errors import Refused
from fleet.runtime.decoding import convert

MethodT = TypeVar("MethodT", bound=Callable[..., Any])
_MARK = "__fleet_commands__"
_WRONG_TYPE = re.compile(r"Expected `([^`]+)`, got `([^`]+)`(?: - at `\$\.?([^`]*)`)?")
_MISSING = re.compile(r"Object missing required field `([^`]+)`")
_TYPES = {
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "array": "a list",
    "object": "an object",
    "null": "nothing",
}
"""What msgspec calls a type, and people do."""


class Range(msgspec.Struct, frozen=True):
    """The least and the most that a number in a command's data may be, and its unit.

    Stands in the annotation: ``altitude: Annotated[float, Range(1, 120, "m")]``; of a list it bounds each
    element. What is outside is refused before the method is called, and so is not-a-number.
    """

    least: float
    most: float
    unit: str

    def __str__(self) -> str:
        return f"{self.least:g} to {self.most:g} {self.unit}"

    def has(self, value: float) -> bool:
        """Return True for a finite number within the range."""
        return self.least <= value <= self.most and math.isfinite(value)


class CommandSpec(msgspec.Struct, frozen=True):
    """One declared command.

    ``timeout``: seconds until the host gives up on it. ``safe``: allowed while an emergency stop is
    latched (it can only make things safer). ``moves``: the robot may move because of it, so the control
    lease applies and it ends a running action; but ``interrupts`` False: it ends none, and is refused as busy
    while there is one. ``streams``: the method is an async generator whose first yield means that the robot
    took the command. ``ranges``: those of its parameters that have one.
    """

    name: str
    method: str
    timeout: float
    safe: bool
    moves: bool
    streams: bool
    parameters: type[msgspec.Struct]
    summary: str
    interrupts: bool = True
    ranges: Mapping[str, Range] = {}


def command(
    *names: str, timeout: float = 10.0, safe: bool = False, moves: bool = True, interrupts: bool = True
) -> Callable[[MethodT], MethodT]:
    """Declare a method as the command ``names`` (the first is its name, the rest aliases).

    The method is a coroutine (returning means: seen to be done; what it returns, plain JSON values, is the
    answer of a command that asks for something) or an async generator of ``Progress``
    (the first yield means: the robot took it; the end means: seen to be done). On a FrameAdapter it yields
    the frames to write. Its parameters, all
    keyword-only or with defaults and annotated with plain types, are the command's data; each number has a
    ``Range``. It raises NotReady, Refused, Unsupported, TimedOut or Fault.
    """

    def mark(method: MethodT) -> MethodT:
        setattr(method, _MARK, (names, timeout, safe, moves, interrupts))
        return method

    return mark


def commands_of(owner: type) -> Mapping[str, CommandSpec]:
    """Return the commands that a class declares, by name; a subclass's own method wins."""
    found: dict[str, CommandSpec] = {}
    for attribute, method in inspect.getmembers(owner, callable):
        marked = getattr(method, _MARK, None)
        if marked is None:
            continue
        names, timeout, safe, moves, interrupts = marked
        for name in names:
            found[name] = CommandSpec(
                name=name,
                method=attribute,
                timeout=timeout,
                safe=safe,
                moves=moves,
                streams=inspect.isasyncgenfunction(method),
                parameters=_parameters_of(method),
                summary=(inspect.getdoc(method) or "").partition("\n")[0],
                interrupts=interrupts,
                ranges=_ranges_of(method),
            )
    return found


def _parameters_of(method: Callable[..., object]) -> type[msgspec.Struct]:
    """Make the strict type of a method's keyword parameters."""
    hints = typing.get_type_hints(method)
    fields: list[Any] = []
    for parameter in list(inspect.signature(method).parameters.values())[1:]:
        kind = hints[parameter.name]
        if parameter.default is inspect.Parameter.empty:
            fields.append((parameter.name, kind))
        else:
            fields.append((parameter.name, kind, parameter.default))
    return msgspec.defstruct(f"{method.__name__}_data", fields, kw_only=True)


def _ranges_of(method: Callable[..., Any]) -> dict[str, Range]:
    """Return the ranges in a method's annotations, by parameter; ``X | None`` has that of X."""
    hints = typing.get_type_hints(method, include_extras=True)
    found = {}
    for name in list(inspect.signature(method).parameters)[1:]:
        for form in (hints[name], *typing.get_args(hints[name])):
            for note in typing.get_args(form)[1:] if typing.get_origin(form) is Annotated else ():
                if isinstance(note, Range):
                    found[name] = note
    return found


def arguments(spec: CommandSpec, data: Mapping[str, object]) -> dict[str, object]:
    """Return the keyword arguments for a command, checked strictly.

    A safe command without parameters ignores its data, so that nothing can keep a landing from happening,
    and so does one that does not move the robot. Raises Refused naming the field that is unknown, missing,
    of the wrong type or out of its range.
    """
    known = spec.parameters.__struct_fields__
    if not known and (spec.safe or not spec.moves):
        return {}
    for key in data:
        if key not in known:
            raise Refused(f"{spec.name} takes no {key!r}", hint=_hint(spec, key))
    try:
        values = convert(dict(data), spec.parameters)
    except msgspec.ValidationError as error:
        raise Refused(f"{spec.name}: {_plainly(str(error))}") from None
    found = {name: getattr(values, name) for name in known}
    for name in data:
        _require_within(spec, name, found[name])
    return found


def _hint(spec: CommandSpec, key: str) -> str:
    """Return which parameter was perhaps meant, else what the command takes."""
    known = spec.parameters.__struct_fields__
    near = difflib.get_close_matches(key, known, n=1)
    if near:
        return f"did you mean {near[0]!r}?"
    said = [f"{name} ({spec.ranges[name]})" if name in spec.ranges else name for name in known]
    return f"it takes {', '.join(said) or 'no data'}"


def _require_within(spec: CommandSpec, name: str, value: object) -> None:
    """Refuse a number, or a list with one, that is not finite or not within its range."""
    for each in value if isinstance(value, list) else (value,):
        if isinstance(each, bool) or not isinstance(each, int | float):
            continue
        bounds = spec.ranges.get(name)
        if bounds is not None and not bounds.has(each):
            raise Refused(f"{spec.name}: {name} must be {bounds}, not {each:g}")
        if not math.isfinite(each):
            raise Refused(f"{spec.name}: {name} must be a finite number")


def _plainly(words: str) -> str:
    """Return what msgspec says is wrong in words for whoever sent it, without its name for types."""
    if wrong := _WRONG_TYPE.fullmatch(words):
        wanted = " or ".join(_TYPES.get(each, each) for each in wrong[1].split(" | ") if each != "null")
        return f"{wrong[3] or 'its data'} must be {wanted}, not {_TYPES.get(wrong[2], wrong[2])}"
    missing = _MISSING.match(words)
    return f"{missing[1]} is missing" if missing else words
