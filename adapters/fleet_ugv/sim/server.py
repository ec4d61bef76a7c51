"""All simulated bases of one process, and the JSON lines that command them.

    {"add": {"profile": "waveshare-beast"}}   -> {"url": "serial:/tmp/.../1?baud=115200"}
    {"fault": {"url": "...", "name": "stall", "value": 1}}   -> {}   (value null ends it)
    {"look": {"url": "..."}}   -> {"x": 0.1, "y": 0, "yaw": 0, "left": 0, "right": 0}
    {"remove": {"url": "..."}}   -> {}

What cannot be done is answered by ``{"error": "why"}``.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import msgspec

from fleet_ugv.profiles import PROFILES
from fleet_ugv.sim.port import STEP, SimPort
from fleet_ugv.sim.spec import SimSpec, board_of


class PortAsk(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something about the base behind ``url``."""

    url: str
    name: str = ""
    value: float | None = None


class Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One line: exactly one of them."""

    add: SimSpec | None = None
    fault: PortAsk | None = None
    look: PortAsk | None = None
    remove: PortAsk | None = None


class SimServer:
    """The bases; their device files are in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = 0
        self.ports: dict[str, SimPort] = {}

    def add(self, spec: SimSpec) -> SimPort:
        """Add a base; raises ValueError for one that does not exist."""
        board = board_of(spec)
        self._count += 1
        port = SimPort(board, self._folder / f"{spec.profile}-{self._count}", PROFILES[spec.profile].baud)
        self.ports[port.url] = port
        return port

    def answer(self, line: bytes) -> bytes:
        """Carry out one line; return the line that answers it."""
        try:
            told = self._carry_out(msgspec.json.decode(line, type=Line))
        except (ValueError, OSError) as error:
            told = {"error": str(error)}
        return msgspec.json.encode(told) + b"\n"

    def _carry_out(self, ask: Line) -> dict[str, Any]:
        """Carry out one ask; raises ValueError."""
        if ask.add is not None:
            return {"url": self.add(ask.add).url}
        if ask.fault is not None:
            self._port(ask.fault).fault(ask.fault.name, ask.fault.value)
            return {}
        if ask.look is not None:
            physics = self._port(ask.look).board.physics
            left, right = physics.speeds
            return {"x": physics.x, "y": physics.y, "yaw": physics.yaw, "left": left, "right": right}
        if ask.remove is not None:
            self._port(ask.remove).close()
            del self.ports[ask.remove.url]
            return {}
        raise ValueError("say one of add, fault, look and remove")

    def _port(self, ask: PortAsk) -> SimPort:
        """Return the base that is meant; raises ValueError."""
        if ask.url not in self.ports:
            raise ValueError(f"there is no simulated base at {ask.url}")
        return self.ports[ask.url]

    async def run(self) -> None:
        """Let all bases live until cancelled; then pull every cable."""
        try:
            while True:
                for port in list(self.ports.values()):
                    port.step()
                await asyncio.sleep(STEP)
        finally:
            for port in self.ports.values():
                port.close()
