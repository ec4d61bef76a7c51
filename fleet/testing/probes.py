"""What the contract tests are made of: work with a time-out, noise, and looks inside values."""

from __future__ import annotations

import collections
import random
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ParamSpec, TypeVar

import msgspec

from fleet.adapter import Adapter, FrameAdapter
from fleet.errors import CommandError

SOON = 10.0  # s; what does not block takes no time, but test computers are slow
_MUTABLE = (list, set, bytearray, collections.deque)
_BASES = (Adapter, FrameAdapter)
ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")


def in_time(work: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs) -> ResultT:
    """Do work on another thread and return its result; raises what it raises.

    Raises AssertionError when it is not done within ``SOON``: it blocks.
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
    """Return the result of work, None when it was refused in the way the host understands."""
    try:
        return work(*args, **kwargs)
    except CommandError:
        return None


def noise_like(frames: list[bytes]) -> Iterator[bytes]:
    """Yield what bad lines make of frames: cut, repeated, corrupted, with impossible numbers; and rubbish."""
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
    """Yield every float in a report, however deep."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, msgspec.Struct):
        yield from numbers_in(msgspec.structs.asdict(value))
    elif isinstance(value, Mapping):
        yield from numbers_in(list(value.values()))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from numbers_in(item)


def containers_of(adapter: Adapter[Any] | FrameAdapter[Any]) -> set[int]:
    """Return the identities of the changeable containers that an adapter holds, its classes' included."""
    own = [value for value in vars(adapter).values() if isinstance(value, (*_MUTABLE, dict))]
    shared = [
        value
        for cls in type(adapter).__mro__
        if issubclass(cls, _BASES) and cls not in _BASES
        for value in vars(cls).values()
        if isinstance(value, _MUTABLE)
    ]
    inner = [vars(adapter)["inner"]] if isinstance(vars(adapter).get("inner"), FrameAdapter) else []
    return {id(value) for value in own + shared}.union(*(containers_of(part) for part in inner))
