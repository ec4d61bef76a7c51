"""Common base of the simulated boards: time, the dead-man, faults of the wire; pure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from random import Random

from fleet.sim.faults import BadWire, check_fault
from fleet_ugv.sim.faults import FAULTS
from fleet_ugv.sim.physics import STEP, BaseBody, Physics

JUNK = b'\x00\xfe~{"T":1001,'


class SimBoard(ABC):
    """A board and its base. ``receive`` and ``step`` take the time (s) and return the board's output.

    ``timeout``: of its dead-man, s. ``halted_at``: time at which it last stopped the wheels.
    """

    def __init__(self, body: BaseBody, *, timeout: float, voltage: float, seed: int = 1) -> None:
        self.physics = Physics(body, seed)
        self.timeout = timeout
        self.voltage = voltage
        self.faults: dict[str, float] = {}
        self.halted_at: float | None = None
        self._commanded_at = 0.0  # time of the last motion command
        self._now = 0.0
        self._rest_of_piece = b""
        random = Random(seed)  # noqa: S311 - repeatable on purpose
        self._to_host = BadWire(self.faults, random)
        self._to_board = BadWire(self.faults, random)

    @abstractmethod
    def handle_bytes(self, data: bytes, now: float) -> bytes:
        """Handle received bytes; return the answers."""

    @abstractmethod
    def speak(self, now: float) -> bytes:
        """Return the unsolicited output of the board at this time."""

    @abstractmethod
    def restart(self, now: float) -> None:
        """Reset the board, as after a power loss: counters, settings, speeds."""

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the host; return the bytes that reach it."""
        self._pass(now)
        echo = data if "echo" in self.faults else b""
        heard = b"".join(self._to_board.carry([data], now))
        return self._out(echo + (self.handle_bytes(heard, now) if heard else b""), now)

    def step(self, now: float) -> bytes:
        """Advance the time; return the bytes that reach the host."""
        self._pass(now)
        late = b"".join(self._to_board.carry([], now))
        return self._out((self.handle_bytes(late, now) if late else b"") + self.speak(now), now)

    def set_fault(self, name: str, value: float | None) -> None:
        """Start a fault; None ends it. Raises ValueError for an unknown fault."""
        if value is None:
            self.faults.pop(name, None)
        else:
            check_fault(name, value, FAULTS)
            self._begin(name, value)
        self.physics.stalled = "stall" in self.faults
        self.physics.slip = self.faults.get("slip", 0.0)

    def _begin(self, name: str, value: float) -> None:
        """Apply a momentary fault at once, and store a lasting one."""
        if name == "reset":
            self.restart(self._now)
        elif name == "bump":
            self.physics.bump(value)
        elif name == "low_battery":
            self.voltage = value
        else:
            self.faults[name] = value

    def hold(self, left: float, right: float, now: float) -> None:
        """Set the speeds of the sides, m/s, and feed the dead-man."""
        self.physics.wanted = [left, right]
        self._commanded_at = now
        self.halted_at = None

    def _pass(self, now: float) -> None:
        """Advance the base step by step; the dead-man acts at its exact time."""
        while self._now + STEP <= now:
            self._now += STEP
            if self._now - self._commanded_at > self.timeout and any(self.physics.wanted):
                self.physics.wanted = [0.0, 0.0]
                self.halted_at = self._now
            self.physics.step()

    def _out(self, said: bytes, now: float) -> bytes:
        """Pass the board's output through the faulty wire."""
        if "mute" in self.faults:
            said = b""
        if said and "garbage" in self.faults:
            said = JUNK + b"\n" + said
        said, self._rest_of_piece = self._rest_of_piece + said, b""
        if "partial" in self.faults:
            half = len(said) // 2
            said, self._rest_of_piece = said[:half], said[half:]
        return b"".join(self._to_host.carry([said] if said else [], now))
