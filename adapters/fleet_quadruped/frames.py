"""Values in CAN frames, defined by a map of identifiers, bytes and values.

Used for sensors without a standard protocol (IMU, battery) and for self-walking machines.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from fleet_quadruped.frame_integrity import FrameIntegrity, ProtectedFrame

Type = Literal["u8", "i8", "u16", "i16", "u32", "i32", "f32"]
_CODES: Mapping[str, str] = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}
_RANGES: Mapping[str, tuple[float, float]] = {"f32": (-3.4e38, 3.4e38)} | {
    kind: (-(1 << bits - 1), (1 << bits - 1) - 1) if kind[0] == "i" else (0, (1 << bits) - 1)
    for kind, bits in (("u8", 8), ("i8", 8), ("u16", 16), ("i16", 16), ("u32", 32), ("i32", 32))
}


def _scale(value: float) -> float:
    if value == 0:
        raise ValueError("a scale of 0 makes every value 0")
    return value


class Number(BaseModel):
    """Encoding of a value: a raw number, times ``scale``, plus ``offset``."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    type: Type = Field(description="Raw data type.")
    scale: Annotated[float, AfterValidator(_scale)] = Field(1.0, description="Value of one raw unit.")
    offset: float = Field(0.0, description="Value of raw zero.")
    invalid: int | None = Field(None, description="Raw number that means that the value is unknown.")

    @property
    def farthest(self) -> float:
        """Largest magnitude that can be encoded."""
        return max(abs(raw * self.scale + self.offset) for raw in _RANGES[self.type])


class FieldMap(Number):
    """One value of a frame, at byte ``at``."""

    at: int = Field(ge=0, le=63, description="First byte.")
    endian: Literal["big", "little"] = Field("little", description="Byte order.")

    @cached_property
    def layout(self) -> struct.Struct:
        """Layout of the value for ``struct``."""
        return struct.Struct((">" if self.endian == "big" else "<") + _CODES[self.type])


class FrameMap(ProtectedFrame):
    """One frame: its values by name, its length, and its constant bytes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: int = Field(ge=0, le=0x1FFFFFFF, description="Identifier; extended above 7FFh.")
    fields: dict[str, FieldMap] = Field(min_length=1, description="Values in the frame.")
    dlc: int | None = Field(None, ge=1, le=8, description="Length in bytes, if longer than the values need.")
    data: str = Field(
        "", pattern=r"^([0-9a-fA-F]{2}){0,8}$", description="Constant data in the other bytes, hex."
    )

    @model_validator(mode="after")
    def _apart(self) -> FrameMap:
        """Refuse overlapping fields, constants under a field, and bytes beyond the frame's end."""
        taken = dict(self.integrity_bytes)
        if len(taken) < sum(part is not None for part in (self.counter, self.checksum)):
            raise ValueError("counter and checksum are in the same byte")
        constants = bytes.fromhex(self.data)
        for name, field in self.fields.items():
            for place in range(field.at, field.at + field.layout.size):
                if place in taken:
                    raise ValueError(f"byte {place} is in both {taken[place]!r} and {name!r}")
                taken[place] = name
        for place, name in taken.items():
            if constants[place : place + 1].strip(b"\x00"):
                raise ValueError(f"byte {place} is {constants[place]:02X}h in data, and {name!r} is there")
        if self.dlc is not None and self.dlc < self.needed:
            raise ValueError(f"dlc: {self.dlc} bytes, and {self.needed} are in it")
        return self

    @property
    def needed(self) -> int:
        """Number of bytes up to the last value, constant, counter or checksum."""
        ends = [field.at + field.layout.size for field in self.fields.values()]
        return max([*ends, len(self.data) // 2, *(place + 1 for place in self.integrity_bytes)])

    @property
    def length(self) -> int:
        """Number of bytes in the frame."""
        return self.dlc or self.needed


def _layouts(frame: FrameMap) -> list[tuple[struct.Struct, list[str]]]:
    """Return, for each byte order in the frame, a layout of the whole frame and the names of its values."""
    found = []
    for order, sign in (("little", "<"), ("big", ">")):
        fields = sorted((field.at, name) for name, field in frame.fields.items() if field.endian == order)
        form, end = sign, 0
        for at, name in fields:
            form += f"{at - end}x{_CODES[frame.fields[name].type]}"
            end = at + frame.fields[name].layout.size
        if fields:
            found.append((struct.Struct(f"{form}{frame.length - end}x"), [name for _, name in fields]))
    return found


class FrameDecoder:
    """Decodes values from the frames of a map.

    A frame with a wrong checksum or an unchanged counter is ignored.
    """

    def __init__(self, frames: Iterable[FrameMap]) -> None:
        frames = tuple(frames)
        self._plans = {frame.id: (frame.length, _readings(frame)) for frame in frames}
        self._integrity = {
            frame.id: FrameIntegrity(frame.id, frame) for frame in frames if frame.integrity_bytes
        }

    def decode(self, identifier: int, data: bytes) -> dict[str, float] | None:
        """Return the valid values of a frame; None for an unknown, short or corrupt frame."""
        plan = self._plans.get(identifier)
        if plan is None or len(data) < plan[0]:
            return None
        integrity = self._integrity.get(identifier)
        if integrity is not None and not integrity.accepts(data):
            return None
        found: dict[str, float] = {}
        for unpack_from, fields in plan[1]:
            for (name, scale, offset, invalid), raw in zip(fields, unpack_from(data), strict=True):
                value = raw * scale + offset
                if raw != invalid and math.isfinite(value):
                    found[name] = value
        return found


_Reading = tuple[Callable[[bytes], tuple[float, ...]], list[tuple[str, float, float, int | None]]]


def _readings(frame: FrameMap) -> list[_Reading]:
    """Return the unpackers of a frame, each with name, scale, offset and invalid number of its values."""
    fields = {name: (name, field.scale, field.offset, field.invalid) for name, field in frame.fields.items()}
    return [(layout.unpack_from, [fields[name] for name in names]) for layout, names in _layouts(frame)]


class FrameEncoder:
    """Encodes values into one frame of a map."""

    def __init__(self, frame: FrameMap) -> None:
        self._length = frame.length
        self._constant = int.from_bytes(bytes.fromhex(frame.data).ljust(frame.length, b"\x00"), "big")
        fields = {
            name: (name, field.scale, field.offset, *_RANGES[field.type], field.type != "f32")
            for name, field in frame.fields.items()
        }
        self._plan = [(layout.pack, [fields[name] for name in names]) for layout, names in _layouts(frame)]

    def encode(self, values: Mapping[str, float]) -> bytes:
        """Return the data; values out of range are clamped, never wrapped; missing values are raw zero.

        Raises ValueError for NaN.
        """
        data = self._constant
        for pack, fields in self._plan:
            numbers = []
            for name, scale, offset, low, high, whole in fields:
                raw = (values.get(name, offset) - offset) / scale
                if not low <= raw <= high:
                    if math.isnan(raw):
                        raise ValueError(f"{name} is not a number")
                    raw = low if raw < low else high
                numbers.append(round(raw) if whole else raw)
            data |= int.from_bytes(pack(*numbers), "big")
        return data.to_bytes(self._length, "big")


def encode(frame: FrameMap, values: Mapping[str, float]) -> bytes:
    """Return the data of one frame; ``FrameEncoder`` is faster for many."""
    return FrameEncoder(frame).encode(values)
