"""Parts of the contract tests: work with a timeout, noise, and inspection of values."""

from __future__ import annotations

import collections
import logging
import math
import random
import re
import threading
import typing
from collections.abc import Callable, Iterator, Mapping
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import msgspec
from pydantic import BaseModel

from fleet.adapter import Adapter, AdapterBase, FrameAdapter
from fleet.commands import CommandSpec
from fleet.errors import CommandError
from fleet.model.geometry import Velocity

SOON = 10.0  # s; non-blocking work takes no time, but test computers are slow
_MUTABLE = (list, set, bytearray, collections.deque)
_BASES = (AdapterBase, Adapter, FrameAdapter)
_NOT_STATE = frozenset({"framing", "_abc_impl"})
_SHAREABLE = (
    type,
    FunctionType,
    classmethod,
    staticmethod,
    property,
    BaseModel,
    msgspec.Struct,
    logging.Logger,
)
ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")


def in_time(work: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs) -> ResultT:
    """Run work on another thread and return its result; raises its exception.

    Raises AssertionError if it does not return within ``SOON`` seconds, because it blocks.
    """
    results: list[ResultT] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            results.append(work(*args, **kwargs))
        except BaseException as error:  # noqa: BLE001 - raised again on the caller's thread
            errors.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(SOON)
    assert not thread.is_alive(), f"{work} blocks"
    if errors:
        raise errors[0]
    return results[0]


def unless_refused(
    work: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs
) -> ResultT | None:
    """Return the result of work; None if it raised a CommandError, which the host understands."""
    try:
        return work(*args, **kwargs)
    except CommandError:
        return None


def corrupted_frames(frames: list[bytes]) -> Iterator[bytes]:
    """Yield corrupted frames: cut, repeated, with flipped bytes or impossible numbers; and random bytes."""
    source = random.Random(0)  # noqa: S311 - repeatable on purpose
    yield b""
    for length in range(1, 200):
        yield source.randbytes(length)
    for frame in frames:
        yield from (frame[:end] for end in range(len(frame)))
        yield from (frame[start:] for start in range(1, len(frame)))
        yield frame + frame
        yield from (re.sub(rb"-?\d+(\.\d+)?", number, frame) for number in (b"nan", b"inf", b"1e999", b"-"))
        for _ in range(100):
            changed = bytearray(frame)
            changed[source.randrange(len(frame))] = source.randrange(256)
            yield bytes(changed)


def numbers_in(value: object) -> Iterator[float]:
    """Yield every number in a report, at any depth; a truth value is none."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield value
    elif isinstance(value, msgspec.Struct):
        yield from numbers_in(msgspec.structs.asdict(value))
    elif isinstance(value, Mapping):
        yield from numbers_in(list(value.values()))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from numbers_in(item)


_PLAUSIBLE: dict[str, tuple[float, float]] = {
    "BatteryReport.percent": (0.0, 100.0),
    "BatteryReport.voltage": (0.0, 1000.0),
    "BatteryReport.current": (-1000.0, 1000.0),
    "PoseReport.position": (-1e6, 1e6),
    "PoseReport.rotation": (-1.001, 1.001),
    "ImuReport.gyro": (-100.0, 100.0),
    "ImuReport.accel": (-1000.0, 1000.0),
    "JointReport.positions": (-1000.0, 1000.0),
    "GpsReport.heading": (-360.0, 360.0),
}
"""Bounds of plausible measurements in the units of the reports; a wrong unit exceeds them."""
_STAMP_OFF = 3600.0  # s


def implausible(report: Any, now: float) -> str:
    """Return the error in an impossible report: not-a-number, wrong unit, stamp far from ``now`` (Unix s)."""
    kind = type(report).__name__
    if not all(math.isfinite(number) for number in numbers_in(report) if isinstance(number, float)):
        return f"{report} has a number that is not finite; leave out what is unknown"
    if abs(getattr(report, "stamp", now) - now) > _STAMP_OFF:
        return f"{kind} has the stamp {report.stamp:g}; give Unix seconds of robot.clock.time()"
    for name, (least, most) in _PLAUSIBLE.items():
        owner, _, field = name.partition(".")
        values = list(numbers_in(getattr(report, field))) if owner == kind else []
        if any(not least <= value <= most for value in values):
            return f"{name} is {values}, beyond {least:g} to {most:g}: is the unit right?"
    return ""


def containers_of(adapter: Adapter[Any] | FrameAdapter[Any]) -> set[int]:
    """Return the identities of the mutable containers of an adapter and of its classes."""
    own = [value for value in vars(adapter).values() if isinstance(value, (*_MUTABLE, dict))]
    shared = [
        value
        for cls in type(adapter).__mro__
        if issubclass(cls, _BASES) and cls not in _BASES
        for name, value in vars(cls).items()
        if isinstance(value, _MUTABLE) or (name not in _NOT_STATE and _has_state(name, value))
    ]
    inner = [vars(adapter)["inner"]] if isinstance(vars(adapter).get("inner"), FrameAdapter) else []
    return {id(value) for value in own + shared}.union(*(containers_of(part) for part in inner))


def _has_state(name: str, value: object) -> bool:
    """Return True for a value that all robots of a class would share: a dictionary or a stateful object.

    A table in capitals is a constant.
    """
    if isinstance(value, dict):
        return not (name.startswith("__") or name.isupper())
    return bool(getattr(value, "__dict__", None)) and not isinstance(value, _SHAREABLE)


def near(velocity: Velocity | None, wanted: Velocity) -> bool:
    """Return True if two velocities agree within 30 % plus 0.05 (m/s, rad/s) in each component."""
    if velocity is None:
        return False
    return all(
        abs(a - b) <= 0.05 + 0.3 * abs(b) for a, b in zip(_parts(velocity), _parts(wanted), strict=True)
    )


def _parts(velocity: Velocity) -> tuple[float, ...]:
    """Return the components of a velocity."""
    return velocity.linear.x, velocity.linear.y, velocity.linear.z, velocity.yaw_rate


def least_data(spec: CommandSpec) -> dict[str, Any]:
    """Return the minimal data of a command: only required parameters, with their lowest values."""
    required = [field for field in msgspec.structs.fields(spec.parameters) if field.required]
    return {field.name: _least(spec, field) for field in required}


def _least(spec: CommandSpec, field: msgspec.structs.FieldInfo) -> Any:
    """Return the lowest value of a number, or the empty value of another type."""
    bounds = spec.ranges.get(field.name)
    if bounds is not None:
        return bounds.least if math.isfinite(bounds.least) else 0
    form = field.type
    while typing.get_origin(form) is typing.Annotated:
        form = typing.get_args(form)[0]
    if typing.get_origin(form) is typing.Literal:
        return typing.get_args(form)[0]
    return (typing.get_origin(form) or form)()
