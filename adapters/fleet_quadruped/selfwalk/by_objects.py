"""Self-walking CANopen machine: the section ``objects`` of its description.

Velocity and state are mapped to PDOs, so that they take one frame each per cycle; a command is a write of one
object (SDO). CiA 301.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import AfterValidator, Field, model_validator

from fleet import CanFrame
from fleet_quadruped.drives.cia402.frames import HEARTBEAT, MASTER, OPERATIONAL, SDO_REQUEST, SYNC
from fleet_quadruped.drives.cia402.setup import Object, pdo_objects
from fleet_quadruped.frames import FieldMap, FrameMap, Number, encode
from fleet_quadruped.robot.busload import SLOW_EVERY
from fleet_quadruped.robot.parts import Section
from fleet_quadruped.selfwalk.wire import AXES, COMMANDS, WalkerWire

SDO_ABORT = 0x80
RPDO, TPDO = 0x200, 0x180  # COB-ID of the first PDO; each further one adds 100h
_MOST_PDOS = 4
_AT_ONCE, _AT_SYNC = 255, 1  # transmission types
_SIZES: Mapping[str, int] = {"u8": 1, "i8": 1, "u16": 2, "i16": 2, "u32": 4, "i32": 4, "f32": 4}


class PdoEntry(Number):
    """A number in the object dictionary."""

    index: int = Field(ge=0x1000, le=0xFFFF, description="Index of the object.")
    sub: int = Field(0, ge=0, le=255, description="Subindex of the object.")

    @property
    def mapping(self) -> int:
        """Entry in a PDO mapping."""
        return self.index << 16 | self.sub << 8 | 8 * _SIZES[self.type]

    def at(self, place: int) -> FieldMap:
        """Return the field at a byte position in a frame."""
        return FieldMap(at=place, **self.model_dump(include=set(Number.model_fields)))


class ObjectSetting(Section):
    """A constant to be written into the object dictionary."""

    index: int = Field(ge=0x1000, le=0xFFFF, description="Index of the object.")
    sub: int = Field(0, ge=0, le=255, description="Subindex of the object.")
    type: Literal["u8", "u16", "u32"] = Field(description="Data type.")
    value: int = Field(ge=0, le=0xFFFFFFFF, description="Value to write.")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        """Return the setting; raises ValueError for a value beyond its type."""
        most = (1 << 8 * _SIZES[self.type]) - 1
        if self.value > most:
            raise ValueError(f"{self.value} does not fit into {self.type}, 0 to {most}")
        return self

    def object(self, what: str) -> Object:
        """Return the object to be written."""
        return Object(self.index, self.sub, _SIZES[self.type], self.value, what)


def _axes(entries: dict[str, PdoEntry]) -> dict[str, PdoEntry]:
    if set(entries) != set(AXES):
        raise ValueError(f"a velocity has the entries {', '.join(AXES)}")
    return entries


def _fit(entries: dict[str, PdoEntry]) -> dict[str, PdoEntry]:
    if len(list(_groups(entries))) > _MOST_PDOS:
        raise ValueError(f"these do not fit into {_MOST_PDOS} PDOs of eight bytes")
    return entries


class Objects(Section):
    """Objects by meaning. The machine's heartbeat consumer (1016h) is armed with ``silence``."""

    node: int = Field(ge=1, le=126, description="Node ID.")
    setup: tuple[ObjectSetting, ...] = Field(
        (), description="Written after the bus is opened, and read back."
    )
    velocity: Annotated[dict[str, PdoEntry], AfterValidator(_axes), AfterValidator(_fit)] = Field(
        description="Velocity: x, y, turn."
    )
    stand_up: ObjectSetting
    sit_down: ObjectSetting
    emergency_stop: ObjectSetting = Field(description="Fastest stop that lowers the machine gently.")
    recovery_stand: ObjectSetting | None = None
    reset_faults: ObjectSetting | None = None
    height: PdoEntry | None = Field(None, description="Standing height.")
    state: Annotated[dict[str, PdoEntry], AfterValidator(_fit)] = Field(
        description="State sent in every cycle."
    )
    slow: dict[str, PdoEntry] = Field(
        {}, description="Values sent at a lower rate: percent, voltage, current."
    )


def wire_of(objects: Objects, silence: float) -> WalkerWire:
    """Return the messages of the machine; raises ValueError if they need too many PDOs."""
    node, height = objects.node, objects.height
    velocity = _pdos(objects.velocity, RPDO + node, _AT_ONCE)
    state = _pdos(objects.state, TPDO + node, _AT_SYNC)
    slow = _pdos(objects.slow, TPDO + node, SLOW_EVERY, first=len(state))
    mapped = state + slow
    if len(mapped) > _MOST_PDOS:
        raise ValueError(f"objects: state and slow do not fit into {_MOST_PDOS} PDOs of eight bytes")
    setup = [Object(0x1016, 1, 4, MASTER << 16 | round(silence * 1000), "time until our silence stops it")]
    setup += [one.object("setup") for one in objects.setup]
    setup += _mapped(velocity, 0x1400, 0x1600) + _mapped(mapped, 0x1800, 0x1A00)
    return WalkerWire(
        velocity=tuple(_frame(pdo.cob, pdo.entries) for pdo in velocity),
        commands=_commands(objects),
        height=(lambda metres: _raised(node, height, metres)) if height else None,
        state=tuple(_frame(pdo.cob, pdo.entries) for pdo in state),
        slow=tuple(_frame(pdo.cob, pdo.entries) for pdo in slow),
        alive=(CanFrame(HEARTBEAT + MASTER, bytes([OPERATIONAL])), CanFrame(SYNC, b"")),
        node=node,
        setup=tuple(setup),
    )


class _Pdo(NamedTuple):
    """One PDO: COB-ID, transmission type and mapped entries."""

    cob: int
    kind: int
    entries: dict[str, PdoEntry]


def _pdos(entries: Mapping[str, PdoEntry], cob: int, kind: int, first: int = 0) -> list[_Pdo]:
    """Return the PDOs that carry the entries; ``first``: number of PDOs already used in this direction."""
    groups = enumerate(_groups(entries), first)
    return [_Pdo(cob + 0x100 * number, kind, group) for number, group in groups]


def _mapped(pdos: Sequence[_Pdo], parameters: int, mapping: int) -> list[Object]:
    """Return the objects that configure PDOs; the arguments are the indices for the first PDO."""
    setup: list[Object] = []
    for number, pdo in enumerate(pdos):
        entries = tuple(entry.mapping for entry in pdo.entries.values())
        setup += pdo_objects(parameters + number, mapping + number, pdo.cob, pdo.kind, entries)
    return setup


def _commands(objects: Objects) -> dict[str, CanFrame]:
    """Return the frame of each command that the machine supports."""
    given: dict[str, ObjectSetting | None] = {name: getattr(objects, name) for name in COMMANDS}
    return {
        name: _written(objects.node, one.object(name), one.value.to_bytes(_SIZES[one.type], "little"))
        for name, one in given.items()
        if one
    }


def _groups(entries: Mapping[str, PdoEntry]) -> Iterator[dict[str, PdoEntry]]:
    """Yield the entries in groups, each small enough for a PDO, in their order."""
    group: dict[str, PdoEntry] = {}
    for name, entry in entries.items():
        if sum(_SIZES[one.type] for one in group.values()) + _SIZES[entry.type] > 8:
            yield group
            group = {}
        group[name] = entry
    if group:
        yield group


def _frame(identifier: int, group: Mapping[str, PdoEntry]) -> FrameMap:
    """Return a PDO as a frame map."""
    fields, place = {}, 0
    for name, entry in group.items():
        fields[name] = entry.at(place)
        place += _SIZES[entry.type]
    return FrameMap(id=identifier, fields=fields)


def _raised(node: int, entry: PdoEntry, metres: float) -> CanFrame:
    """Return the frame that writes the height (m)."""
    data = encode(FrameMap(id=0, fields={"height": entry.at(0)}), {"height": metres})
    return _written(node, Object(entry.index, entry.sub, len(data), 0, "height"), data)


def _written(node: int, item: Object, data: bytes) -> CanFrame:
    """Return the frame that writes an object (expedited SDO download)."""
    head = struct.pack("<BHB", 0x23 | (4 - item.size) << 2, item.place, item.sub)
    return CanFrame(SDO_REQUEST + node, head + data.ljust(4, b"\x00"))
