"""Commands to a running simulator: JSON lines in, one JSON line out for each.

    {"add": {"flavour": "px4", "system_id": 1}}            -> {"added": {"system_id": 1, "port": 40001}}
    {"fault": {"system_id": 1, "name": "loss", "value": 0.05}}  -> {"fault": {"name": "loss", "vehicles": 1}}

A fault's ``value`` null ends it; ``port`` in place of ``system_id`` names one vehicle. What cannot be
done is answered by ``{"error": "why"}``.
"""

from __future__ import annotations

from typing import Any

import msgspec

from fleet_mavlink.sim.server import SimServer
from fleet_mavlink.sim.spec import SimSpec


class FaultAsk(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Begin or end a fault of the vehicles with this system id, or on this port."""

    name: str
    value: float | None = 1.0
    system_id: int | None = None
    port: int | None = None


class ControlLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One line: exactly one of the two."""

    add: SimSpec | None = None
    fault: FaultAsk | None = None


async def answer(server: SimServer, line: bytes) -> bytes:
    """Carry out one line; return the line that answers it, with its newline."""
    try:
        told = await _carry_out(server, msgspec.json.decode(line, type=ControlLine))
    except (ValueError, OSError) as error:
        told = {"error": str(error)}
    return msgspec.json.encode(told) + b"\n"


async def _carry_out(server: SimServer, ask: ControlLine) -> dict[str, Any]:
    if (ask.add is None) == (ask.fault is None):
        raise ValueError("say one of add and fault")
    if ask.add is not None:
        station = await server.add_udp(ask.add)
        return {"added": {"system_id": ask.add.system_id, "port": station.port}}
    assert ask.fault is not None
    return {"fault": {"name": ask.fault.name, "vehicles": _set_fault(server, ask.fault)}}


def _set_fault(server: SimServer, ask: FaultAsk) -> int:
    """Set a fault; return the number of vehicles that have it now."""
    meant = [
        station.wire.vehicle
        for station in server.stations
        if ask.port in {None, station.port} and ask.system_id in {None, station.wire.vehicle.system_id}
    ]
    if not meant:
        raise ValueError("there is no such vehicle")
    for vehicle in meant:
        vehicle.set_fault(ask.name, ask.value)
    return len(meant)
