"""Declaration of commands: ``@command`` marks a method; its signature defines and checks the parameters."""

from __future__ import annotations

import difflib
import inspect
import math
import re
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, TypeVar

import msgspec
import msgspec.inspect

from fleet.errors import Refused
from fleet.runtime.decoding import convert_strictly, json_decoder

MethodT = TypeVar("MethodT", bound=Callable[..., Any])
_MARK = "__fleet_commands__"
_WRONG_TYPE = re.compile(r"Expected `([^`]+)`, got `([^`]+)`(?: - at `\$\.?([^`]*)`)?")
_BEYOND = re.compile(r"Expected `\w+` (?:>=|<=|>|<) \S+(?: - at `\$\.?(\w*)[^`]*`)?")
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
"""Plain names for msgspec's names of types."""


class BadDeclaration(TypeError):
    """A method marked ``@command`` cannot be a command; the message ends with its file and line."""


class Range(msgspec.Struct, frozen=True):
    """Bounds and unit of a number in a command's data.

    Written in an annotation: ``altitude: Annotated[float, Range(1, 120, "m")]``; for a list it bounds each
    element. Values outside and not-a-number are refused before the method is called. An equivalent is
    ``msgspec.Meta(ge=1, le=120, extra={"unit": "m"})``; a missing bound is infinite.
    """

    least: float
    most: float
    unit: str

    def __str__(self) -> str:
        if math.isinf(self.most):
            text = "any" if math.isinf(self.least) else f"at least {self.least:g}"
        else:
            text = f"at most {self.most:g}" if math.isinf(self.least) else f"{self.least:g} to {self.most:g}"
        return f"{text} {self.unit}".rstrip()

    def has(self, value: float) -> bool:
        """Return True for a finite number within the range."""
        return self.least <= value <= self.most and math.isfinite(value)


class CommandSpec(msgspec.Struct, frozen=True):
    """One declared command.

    - ``timeout``: seconds until the host gives up on it.
    - ``safe``: allowed while an emergency stop is latched, because it can only make things safer.
    - ``moves``: may move the robot, so the control lease applies and a running action ends.
    - ``interrupts``: if False, a running action goes on, and the command is refused as busy.
    - ``in_place``: moves the robot, but not to another place (it stands up): allowed outside its fence.
    - ``streams``: the method is an async generator; its first yield means that the robot accepted the
      command.
    - ``ranges``: bounds by parameter.
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
    in_place: bool = False
    ranges: Mapping[str, Range] = {}


def command(
    *names: str,
    timeout: float = 10.0,
    safe: bool = False,
    moves: bool = True,
    interrupts: bool = True,
    in_place: bool = False,
) -> Callable[[MethodT], MethodT]:
    """Declare a method as the command ``names``: the first is its name, the others are aliases.

    The method is a coroutine or an async generator of ``Progress``. A coroutine returns when the command is
    done; its result, in plain JSON values, is the answer to a query. The first yield of a generator means
    that the robot accepted the command, its end that the command is done. On a FrameAdapter the method yields
    the frames to write.

    The parameters are keyword-only or have defaults, and are annotated with plain types. Give each number a
    ``Range``; without one any finite number is accepted. The method raises NotReady, Refused, Unsupported,
    TimedOut or Fault.
    """

    def mark(method: MethodT) -> MethodT:
        setattr(method, _MARK, (names, timeout, safe, moves, interrupts, in_place))
        return method

    return mark


def commands_of(owner: type) -> Mapping[str, CommandSpec]:
    """Return the commands that a class declares, by name; methods of a subclass override."""
    found: dict[str, CommandSpec] = {}
    for attribute, method in inspect.getmembers(owner, callable):
        marked = getattr(method, _MARK, None)
        if marked is None:
            continue
        names, timeout, safe, moves, interrupts, in_place = marked
        _check_timeout(method, timeout)
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
                in_place=in_place,
                ranges=_ranges_of(method),
            )
            _check_defaults(method, found[name])
    return found


def _parameters_of(method: Callable[..., object]) -> type[msgspec.Struct]:
    """Create the strict type of a method's parameters; raises BadDeclaration."""
    hints = _hints_of(method)
    fields: list[Any] = []
    for parameter in _declared(method):
        kind = hints[parameter.name]
        if parameter.default is inspect.Parameter.empty:
            fields.append((parameter.name, kind))
        else:
            fields.append((parameter.name, kind, parameter.default))
    made = msgspec.defstruct(f"{method.__name__}_data", fields, kw_only=True)
    try:
        json_decoder(made)  # builds the decoder under the lock that the first use of a type needs
        known = msgspec.inspect.type_info(made)
    except TypeError as error:
        raise _bad(method, f"a parameter must be a plain type (a number, text, a list): {error}") from error
    for field in known.fields if isinstance(known, msgspec.inspect.StructType) else ():
        if isinstance(field.type, msgspec.inspect.CustomType):
            wanted = "a plain type (a number, text, a list)"
            raise _bad(method, f"{field.name} must be {wanted}, not {field.type.cls.__name__}")
    return made


def _declared(method: Callable[..., Any]) -> list[inspect.Parameter]:
    """Return a method's parameters without ``self``; raises BadDeclaration for ``*args`` and the like."""
    parameters = list(inspect.signature(method).parameters.values())[1:]
    for parameter in parameters:
        if parameter.kind not in {parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY}:
            raise _bad(method, f"{parameter} cannot be given by name; name each parameter")
    return parameters


def _hints_of(method: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of all parameters; raises BadDeclaration if one cannot be enforced."""
    try:
        hints = typing.get_type_hints(method, include_extras=True)
    except Exception as error:
        raise _bad(method, f"its annotations cannot be resolved: {error}") from error
    for parameter in _declared(method):
        if parameter.name not in hints:
            example = f'{parameter.name}: Annotated[float, Range(0, 10, "m")]'
            raise _bad(method, f"{parameter.name} has no type; write it like {example}")
        for note in _notes_of(hints[parameter.name]):
            if not isinstance(note, Range | msgspec.Meta | str):
                hint = "is not enforced here; use Range or msgspec.Meta"
                raise _bad(method, f"{parameter.name}: {note!r} {hint}")
            bounds = _range_of(note)
            if bounds is not None and not bounds.least <= bounds.most:
                swapped = f"its Range begins at {bounds.least:g} and ends at {bounds.most:g}"
                raise _bad(method, f"{parameter.name}: {swapped}; give the lower bound first")
    return hints


def _check_timeout(method: Callable[..., Any], timeout: Any) -> None:
    """Raise BadDeclaration for a timeout that is no positive number of seconds."""
    is_number = isinstance(timeout, int | float) and not isinstance(timeout, bool)
    if not is_number or not 0 < timeout < math.inf:
        raise _bad(method, f"timeout must be a number above 0 s, not {timeout!r}")


def _check_defaults(method: Callable[..., Any], spec: CommandSpec) -> None:
    """Raise BadDeclaration for a default that would be refused as data."""
    hints = _hints_of(method)
    defaults = {each.name: each.default for each in _declared(method) if each.default is not each.empty}
    if not defaults:
        return
    form = msgspec.defstruct("defaults", [(name, hints[name]) for name in defaults])
    try:
        values = convert_strictly(defaults, form)
        for name in defaults:
            _require_within(spec, name, getattr(values, name))
    except msgspec.ValidationError as error:
        why = _plainly(str(error), spec)
    except Refused as error:
        why = str(error).removeprefix(f"{spec.name}: ")
    else:
        return
    raise _bad(method, f"its default would be refused: {why}")


def _bad(method: Callable[..., Any], why: str) -> BadDeclaration:
    """Return the error for a method that cannot be a command, with its file and line."""
    code = getattr(inspect.unwrap(method), "__code__", None)
    place = f" ({code.co_filename}:{code.co_firstlineno})" if code is not None else ""
    return BadDeclaration(f"command method {method.__name__}: {why}{place}")


def _notes_of(form: Any) -> Iterator[Any]:
    """Yield the metadata of an annotation, at any depth."""
    if typing.get_origin(form) is Annotated:
        yield from form.__metadata__
        yield from _notes_of(form.__origin__)
    elif typing.get_origin(form) is not typing.Literal:
        for part in typing.get_args(form):
            yield from _notes_of(part)


def _ranges_of(method: Callable[..., Any]) -> dict[str, Range]:
    """Return the ranges in a method's annotations, by parameter; ``X | None`` has the range of X."""
    hints = _hints_of(method)
    notes = {each.name: list(_notes_of(hints[each.name])) for each in _declared(method)}
    ranges = {name: [_range_of(note) for note in found] for name, found in notes.items()}
    return {name: known[-1] for name, found in ranges.items() if (known := [each for each in found if each])}


def _range_of(note: Any) -> Range | None:
    """Return the range of an annotation, or None."""
    if isinstance(note, Range):
        return note
    if not isinstance(note, msgspec.Meta):
        return None
    least = note.ge if note.ge is not None else note.gt
    most = note.le if note.le is not None else note.lt
    unit = (note.extra or {}).get("unit", "")
    if least is None and most is None and not unit:
        return None
    return Range(-math.inf if least is None else least, math.inf if most is None else most, str(unit))


def arguments(spec: CommandSpec, data: Mapping[str, object]) -> dict[str, object]:
    """Return the keyword arguments of a command, strictly checked.

    A command without parameters that is safe or does not move the robot ignores its data, so that invalid
    data cannot prevent a landing. Raises Refused with the name of a field that is unknown, missing, of the
    wrong type or out of range.
    """
    known = spec.parameters.__struct_fields__
    if not known and (spec.safe or not spec.moves):
        return {}
    for key in data:
        if key not in known:
            raise Refused(f"{spec.name} takes no {key!r}", hint=_hint(spec, key))
    try:
        values = convert_strictly(dict(data), spec.parameters)
    except msgspec.ValidationError as error:
        raise Refused(f"{spec.name}: {_plainly(str(error), spec)}") from None
    found = {name: getattr(values, name) for name in known}
    for name in data:
        _require_within(spec, name, found[name])
    return found


def _hint(spec: CommandSpec, key: str) -> str:
    """Return the most similar parameter name, else the list of parameters."""
    known = spec.parameters.__struct_fields__
    near = difflib.get_close_matches(key, known, n=1)
    if near:
        return f"did you mean {near[0]!r}?"
    said = [f"{name} ({spec.ranges[name]})" if name in spec.ranges else name for name in known]
    return f"it takes {', '.join(said) or 'no data'}"


def _require_within(spec: CommandSpec, name: str, value: object) -> None:
    """Refuse a number, or a list with a number, that is not finite or out of range."""
    for each in value if isinstance(value, list) else (value,):
        if isinstance(each, bool) or not isinstance(each, int | float):
            continue
        bounds = spec.ranges.get(name)
        if bounds is not None and not bounds.has(each):
            raise Refused(f"{spec.name}: {name} must be {bounds}, not {each:g}")
        if not math.isfinite(each):
            raise Refused(f"{spec.name}: {name} must be a finite number")


def _plainly(words: str, spec: CommandSpec) -> str:
    """Translate an error of msgspec into plain words for the sender, without msgspec's type names."""
    beyond = _BEYOND.fullmatch(words)
    if beyond and beyond[1] in spec.ranges:
        return f"{beyond[1]} must be {spec.ranges[beyond[1]]}"
    if wrong := _WRONG_TYPE.fullmatch(words):
        wanted = " or ".join(_TYPES.get(each, each) for each in wrong[1].split(" | ") if each != "null")
        bounds = f" ({spec.ranges[wrong[3]]})" if wrong[3] in spec.ranges else ""
        return f"{wrong[3] or 'its data'} must be {wanted}, not {_TYPES.get(wrong[2], wrong[2])}{bounds}"
    missing = _MISSING.match(words)
    return f"{missing[1]} is missing" if missing else words
