"""Parameters of a vehicle: read by name or all at once, written and verified by reading back.

ArduPilot sends every value as a float; PX4 puts the bits of an integer into the float field, so that 1.0 for
an integer would silently become 1065353216. Neither answers a request for an unknown name.
"""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Callable, Mapping, Sequence

import msgspec

from fleet import Refused, TimedOut
from fleet_mavlink.constants import AUTOPILOT
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.preconditions import require_connection, require_heartbeat
from fleet_mavlink.received_messages import ReceivedMessages
from fleet_mavlink.transfer_messages import ParamRequestList, ParamRequestRead, ParamSet, ParamValue
from fleet_mavlink.vehicle import Vehicle

REAL32 = 9  # MAV_PARAM_TYPE
_INTEGERS: Mapping[int, str] = {1: "<B3x", 2: "<b3x", 3: "<H2x", 4: "<h2x", 5: "<I", 6: "<i"}
_LONGEST_NAME = 16
_MOST_NAMES = 200  # in one read by name
_SILENCE = 1.0  # s without a value after which missing ones are requested again
_ROUNDS = 5  # consecutive requests without an answer
_AT_ONCE = 20  # values requested before waiting for them
_MOST = 5000  # largest credible number of parameters

ParameterValue = int | float


class Parameter(msgspec.Struct, frozen=True):
    """One parameter; ``kind``: its MAV_PARAM_TYPE, which determines whether ``value`` is an integer."""

    name: str
    value: ParameterValue
    kind: int


def decode(said: ParamValue, *, bytewise: bool) -> Parameter:
    """Decode a PARAM_VALUE; NaN and infinity are returned as floats."""
    bits = struct.pack("<I", said.param_value)
    packing = _INTEGERS.get(said.param_type)
    value: ParameterValue
    if packing is not None and bytewise:
        (value,) = struct.unpack(packing, bits)
    else:
        (value,) = struct.unpack("<f", bits)
        if packing is not None and math.isfinite(value):
            value = int(value)
    return Parameter(said.param_id, value, said.param_type)


def encode(name: str, value: ParameterValue, kind: int, *, bytewise: bool) -> int:
    """Return the 32 bits for a value; raises Refused if they cannot represent it exactly."""
    packing = _INTEGERS.get(kind)
    if not math.isfinite(value) or (packing is not None and value != int(value)):
        what = "a whole number" if packing is not None else "a finite number"
        raise Refused(f"{name} is {what}, {value:g} is not")
    try:
        exact = struct.pack(packing, int(value)) if packing is not None else struct.pack("<f", value)
        sensors = exact if bytewise else struct.pack("<f", value)
    except (struct.error, OverflowError):
        raise Refused(f"{value:g} is beyond the range of {name}") from None
    if packing is not None and not bytewise and struct.unpack("<f", sensors)[0] != value:
        raise Refused(f"{value:g} for {name} cannot be sent exactly: the wire carries 24 bits")
    return int.from_bytes(sensors, "little")


def same(one: ParameterValue, other: ParameterValue) -> bool:
    """Return True if two values are the same on the wire."""
    return one == other or struct.pack("<f", one) == struct.pack("<f", other)


class Parameters:
    """Reads and writes the parameters of one vehicle, one transfer at a time."""

    def __init__(self, vehicle: Vehicle, flavour: Callable[[], Flavour]) -> None:
        self._vehicle = vehicle
        self._flavour = flavour
        self._lock = asyncio.Lock()

    async def read(self, names: Sequence[str]) -> list[Parameter]:
        """Return parameters by name; raises Refused for a name that the vehicle does not know."""
        if not 1 <= len(names) <= _MOST_NAMES:
            raise Refused(f"1 to {_MOST_NAMES} names, not {len(names)}", hint="leave them out to read all")
        async with self._lock:
            return [await self._read(name) for name in names]

    async def read_all(self) -> list[Parameter]:
        """Return all parameters, sorted by name; lost ones are requested again."""
        require_connection(self._vehicle)
        async with self._lock:
            with self._vehicle.hearing(ParamValue) as heard:
                found = await self._list(heard)
        return sorted(found.values(), key=lambda parameter: parameter.name)

    async def write(self, name: str, value: ParameterValue) -> tuple[Parameter, Parameter]:
        """Write a parameter and read it back; return the old and the new one.

        Raises Refused for a value that cannot be represented, or that the vehicle did not keep.
        """
        async with self._lock:
            before = await self._read(name)
            bits = encode(name, value, before.kind, bytewise=self._bytewise)
            request = ParamSet(self._vehicle.system, AUTOPILOT, name, bits, before.kind)
            await self._exchange(request, name)
            after = await self._read(name)
        if not same(after.value, value):
            raise Refused(f"{name} is {after.value:g} after it was set to {value:g}")
        return before, after

    @property
    def _bytewise(self) -> bool:
        """Whether integers are sent as their bits."""
        return self._flavour().bytewise_parameters

    async def _read(self, name: str) -> Parameter:
        """Read one parameter by name."""
        if not 0 < len(name) <= _LONGEST_NAME or not name.isascii() or not name.isprintable():
            raise Refused(f"{name!r} is no name of a parameter: 1 to {_LONGEST_NAME} ASCII characters")
        return await self._exchange(ParamRequestRead(self._vehicle.system, AUTOPILOT, name), name)

    async def _exchange(self, request: ParamRequestRead | ParamSet, name: str) -> Parameter:
        """Send a request until the value of this name arrives; a repeat has the same effect."""
        require_connection(self._vehicle)
        bytewise = self._bytewise
        with self._vehicle.hearing(ParamValue) as heard:
            for _ in range(3):
                self._vehicle.send(request)
                said = await heard.first(lambda said: said.param_id == name, _SILENCE)
                if said is not None:
                    return decode(said, bytewise=bytewise)
        raise Refused(
            f"system {self._vehicle.system} has no parameter {name}", hint="or it did not answer; try again"
        )

    async def _list(self, heard: ReceivedMessages[ParamValue]) -> dict[int, Parameter]:
        """Request all parameters, then the missing ones; return them by index."""
        bytewise = self._bytewise
        self._vehicle.send(ParamRequestList(self._vehicle.system, AUTOPILOT))
        found: dict[int, Parameter] = {}
        count = fruitless = 0
        while fruitless < _ROUNDS:
            before = len(found)
            while (said := await heard.next(_SILENCE)) is not None:
                if said.param_index < said.param_count <= _MOST:
                    count = said.param_count
                    found[said.param_index] = decode(said, bytewise=bytewise)
                if count and len(found) >= count:
                    return found
            fruitless = 0 if len(found) > before else fruitless + 1
            self._request_again([index for index in range(count) if index not in found])
        raise TimedOut(f"{len(found)} of {count or 'unknown'} parameters came", hint="is the link good?")

    def _request_again(self, missing: Sequence[int]) -> None:
        """Request missing values by index, a few at a time; all values if none arrived."""
        system = self._vehicle.system
        require_heartbeat(self._vehicle)
        if not missing:
            self._vehicle.send(ParamRequestList(system, AUTOPILOT))
        for index in missing[:_AT_ONCE]:
            self._vehicle.send(ParamRequestRead(system, AUTOPILOT, param_index=index))
