"""State of one ODrive, and its commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from fleet import CanFrame
from fleet_quadruped.drives.base import NEVER, Power
from fleet_quadruped.drives.damping import DampingDrive
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State

_STATE_AGE = 0.35  # s without a heartbeat until a fault


@dataclass(slots=True)
class OdriveAxis(DampingDrive):
    """One drive. The gains are those of the description, as encoded in a command."""

    position_gain: bytes
    velocity_gains: bytes
    state: int | None = None
    state_at: float = NEVER
    errors: int = 0
    version: tuple[int, int] | None = None
    serials: set[bytes] = field(default_factory=set)
    parameters: dict[int, bytes] = field(default_factory=dict)  # by endpoint

    def handle_data(self, command: int, data: bytes, now: float) -> None:
        """Process the data of a command; unknown or short ones are ignored."""
        handle = _HANDLERS.get(command)
        if handle is not None:
            handle(self, data, now)

    def power(self, now: float) -> tuple[Power, str]:
        """Return the state of the drive, and its fault."""
        if self.reported_at == NEVER or self.state is None:
            return Power.ABSENT, ""
        fault = self._fault(now)
        if fault:
            return Power.FAULT, fault
        return (self.obeying if self.state == State.CLOSED_LOOP else Power.DISABLED), ""

    def _fault(self, now: float) -> str:
        """Return the fault of the drive, empty without one."""
        if len(self.serials) > 1:
            return self.duplicate_id_fault
        if self.errors:
            return f"{wire.words(self.errors)} (active errors {self.errors:X}h)"
        if self.restarted:
            return self.torque_off_fault("state 1")
        if now - self.state_at > _STATE_AGE:
            return f"no heartbeat (command 01h) from id {self.id} for {now - self.state_at:.2f} s"
        if self.state not in {State.UNDEFINED, State.IDLE, State.CLOSED_LOOP}:
            return f"id {self.id} is in state {self.state}, in which it moves its motor by itself"
        return ""

    def stay(self) -> None:
        """Send the present position as the target; nothing to a drive that never answered."""
        if self.reported_at > NEVER:
            self.send(OdriveCommand.INPUT_POS, wire.pack_input(*self.units.motor(self.angle, 0.0, 0.0)))

    def send(self, command: OdriveCommand, data: bytes) -> None:
        """Send a command."""
        self.bus.send(CanFrame(wire.identifier(self.id, command), data))

    def handle_estimates(self, data: bytes, now: float) -> None:
        """Process angle and speed."""
        decoded = wire.unpack_pair(data)
        if decoded is None:
            return
        turns, speed = decoded
        self.angle, self.speed, _ = self.units.joint(turns * wire.TURN, speed * wire.TURN, 0.0)
        self.reported_at = now
        self.answers.add(data)

    def handle_heartbeat(self, data: bytes, now: float) -> None:
        """Process errors and state; detect a drive that took its torque off without a command."""
        decoded = wire.unpack_heartbeat(data)
        if decoded is None:
            return
        self.errors, self.state, self.state_at = decoded.errors, decoded.state, now
        self.note_hold(obeys=self.state == State.CLOSED_LOOP, torque_off=not self.errors)

    def handle_torques(self, data: bytes, _now: float) -> None:
        """Process the torque."""
        decoded = wire.unpack_pair(data)
        if decoded is not None:
            self.torque = self.units.joint(0.0, 0.0, decoded[1])[2]

    def handle_temperatures(self, data: bytes, _now: float) -> None:
        """Process the temperature."""
        self.temperature = wire.warmest(data)

    def handle_supply(self, data: bytes, _now: float) -> None:
        """Process the supply voltage."""
        decoded = wire.unpack_pair(data)
        self.voltage = decoded[0] if decoded else self.voltage

    def handle_version(self, data: bytes, _now: float) -> None:
        """Process the firmware version."""
        self.version = wire.unpack_version(data) or self.version

    def handle_address(self, data: bytes, _now: float) -> None:
        """Process the serial number of a drive: two at one id are two drives."""
        if len(data) >= 7:
            self.serials.add(data[1:7])

    def handle_parameter(self, data: bytes, _now: float) -> None:
        """Process a parameter that was read."""
        decoded = wire.unpack_parameter(data)
        if decoded is not None:
            self.parameters[decoded[1]] = decoded[2]


_HANDLERS: Mapping[int, Callable[[OdriveAxis, bytes, float], None]] = MappingProxyType(
    {
        OdriveCommand.ESTIMATES: OdriveAxis.handle_estimates,
        OdriveCommand.HEARTBEAT: OdriveAxis.handle_heartbeat,
        OdriveCommand.TORQUES: OdriveAxis.handle_torques,
        OdriveCommand.TEMPERATURE: OdriveAxis.handle_temperatures,
        OdriveCommand.SUPPLY: OdriveAxis.handle_supply,
        OdriveCommand.VERSION: OdriveAxis.handle_version,
        OdriveCommand.ADDRESS: OdriveAxis.handle_address,
        OdriveCommand.TX_SDO: OdriveAxis.handle_parameter,
    }
)
