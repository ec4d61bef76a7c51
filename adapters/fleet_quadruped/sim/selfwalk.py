"""Simulated self-walking machine, with proprietary frames or as a CANopen node; without physics."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from fleet import CanFrame, Quaternion, quaternion_from_yaw
from fleet.sim.faults import check_fault
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.drives.cia402.frames import HEARTBEAT, OPERATIONAL, SDO_REQUEST, SYNC
from fleet_quadruped.drives.cia402.setup import final_values
from fleet_quadruped.frame_integrity import FrameIntegrity
from fleet_quadruped.frames import FrameDecoder, FrameMap, encode
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.selfwalk.description import SelfWalker
from fleet_quadruped.selfwalk.wire import AXES
from fleet_quadruped.sim.faults import WALKER_FAULTS
from fleet_quadruped.sim.sdo import SdoServer
from fleet_quadruped.sim.wires import BadBuses

GRAVITY = 9.81  # m/s2
_LAG = 0.1  # s: time constant of the velocity
_SLOW = 1.0  # s between two battery messages
_BOOT, _PRE_OPERATIONAL = 0x00, 0x7F
_NOTHING = CanFrame(0x7FF, b"")
_RUNAWAY = Twist(0.5)


class _ModeTransition(NamedTuple):
    """Automatic transition of a mode: delay in seconds, next mode."""

    after: float
    then: BodyMode


_NEXT: Mapping[BodyMode, _ModeTransition] = MappingProxyType(
    {
        BodyMode.RISING: _ModeTransition(1.0, BodyMode.STANDING),
        BodyMode.SITTING: _ModeTransition(1.0, BodyMode.OFF),
        BodyMode.DAMPED: _ModeTransition(1.0, BodyMode.OFF),
        BodyMode.RECOVERING: _ModeTransition(1.5, BodyMode.RISING),
    }
)
_ON_COMMAND: Mapping[str, Mapping[BodyMode, BodyMode]] = MappingProxyType(
    {
        "stand_up": {BodyMode.OFF: BodyMode.RISING},
        "sit_down": dict.fromkeys((BodyMode.RISING, BodyMode.STANDING, BodyMode.WALKING), BodyMode.SITTING),
        "emergency_stop": {
            mode: BodyMode.DAMPED for mode in BodyMode if mode not in {BodyMode.OFF, BodyMode.DAMPED}
        },
        "recovery_stand": {BodyMode.OFF: BodyMode.RECOVERING},
        "reset_faults": {},
    }
)
_ALIKE: Mapping[BodyMode, BodyMode] = MappingProxyType(
    {BodyMode.RISING: BodyMode.OFF, BodyMode.WALKING: BodyMode.STANDING, BodyMode.SITTING: BodyMode.STANDING}
)
"""Mode to report if the machine has no number for the present one; off by default."""


class SimWalker:
    """The machine. ``heard``: callback for the frames that it sends, by bus."""

    def __init__(
        self, walker: SelfWalker, heard: Mapping[str, Callable[[CanFrame], None]], seed: int = 1
    ) -> None:
        self.walker = walker
        self.time = 0.0
        self.mode = BodyMode.OFF
        self.twist = Twist()
        self.place = (0.0, 0.0, 0.0)  # m, m, rad
        self.height = walker.height
        self.percent, self._error, self._tilt = 80.0, 0, 0.0
        self._heard = heard[walker.bus]
        self._wires = BadBuses(walker.buses, seed)
        self._wire = walker.wire
        self._velocity = FrameDecoder(self._wire.velocity)
        self._lengths = {frame.id: frame.length for frame in self._wire.velocity}
        described = (*self._wire.state, *self._wire.slow)
        self._integrity = {
            frame.id: FrameIntegrity(frame.id, frame) for frame in described if frame.integrity_bytes
        }
        self._checks = {
            number: FrameIntegrity(number, protected) for number, protected in self._wire.protected.items()
        }
        self._idle = self._runs_away = False
        self._requested: dict[str, float] = {}
        self._requested_at = -math.inf
        self._since = self._next_state = self._next_slow = 0.0
        self._syncs = 0
        self._muted = False
        self._numbers = {mode: number for number, mode in walker.modes.items()}
        self._commands = {frame: name for name, frame in self._wire.commands.items()}
        self._nmt = _PRE_OPERATIONAL
        self.sdo = self._server()
        if self._wire.node is not None:
            self._say(CanFrame(HEARTBEAT + self._wire.node, bytes([_BOOT])))

    def fault(self, name: str, value: float = 1.0) -> None:
        """Activate a fault; raises ValueError for an unknown one."""
        check_fault(name, value, WALKER_FAULTS)
        if name == "battery":
            self.percent = value
        elif name == "error":
            self._error = round(value)
        elif name == "idle":
            self._idle = True
        elif name == "runs":
            self._runs_away = True
        elif name == "tip":
            self._tilt = value
        elif name == "mute":
            self._muted = True
        else:
            self._wires.faults[name] = value

    def handle_frame(self, bus: str, frame: CanFrame) -> None:
        """Process a frame sent to the machine."""
        for arrived in self._wires.to_dog(bus, [frame], self.time):
            self._deliver(arrived)

    def advance(self, dt: float, *, sense: bool = True) -> None:
        """Advance by ``dt`` seconds; with ``sense``, send the state, unless it is polled."""
        self.time += dt
        for frame in self._wires.to_dog(self.walker.bus, (), self.time):
            self._deliver(frame)
        self._move(dt)
        if sense and self._wire.node is None and self.time >= self._next_state - 1e-9:
            self._next_state = max(self._next_state + self.walker.dt, self.time)
            self._send(self._wire.state)
            if self.time >= self._next_slow:
                self._next_slow = self.time + _SLOW
                self._send(self._wire.slow)
        for frame in self._wires.from_dog(self.walker.bus, (), self.time):
            self._heard(frame)

    def _deliver(self, frame: CanFrame) -> None:
        """Execute a frame."""
        if self._muted:
            return
        if self.sdo is not None:
            self._serve(frame)
        if frame.id in self._lengths:
            self._handle_velocity(frame)
            return
        check = self._checks.get(frame.id)
        if check is not None:
            frame = CanFrame(frame.id, check.bare(frame.data)) if check.accepts(frame.data) else _NOTHING
        name = self._commands.get(frame)
        if name is not None:
            self._command(name)
        height = self.walker.frames.height if self.walker.frames else None
        if height is not None and frame.id == height.id:
            self.height = (FrameDecoder([height]).decode(frame.id, frame.data) or {}).get(
                "height", self.height
            )

    def _handle_velocity(self, frame: CanFrame) -> None:
        """Process a velocity with correct length, counter and checksum."""
        right = len(frame.data) == self._lengths[frame.id] and self._runs()
        found = self._velocity.decode(frame.id, frame.data) if right else None
        if found is not None:
            self._requested.update(found)
            self._requested_at = self.time

    def _command(self, name: str) -> None:
        """Execute a command."""
        if name == "reset_faults":
            self._error = 0
        self._enter(_ON_COMMAND[name].get(self.mode, self.mode))

    def _enter(self, mode: BodyMode) -> None:
        if mode is not self.mode:
            self.mode, self._since = mode, self.time

    def _move(self, dt: float) -> None:
        """Advance the motion; stand still when velocities are missing."""
        step = _NEXT.get(self.mode)
        if step is not None and self.time - self._since >= step.after:
            self._enter(step.then)
        stands = self.mode in {BodyMode.STANDING, BodyMode.WALKING}
        fresh = stands and self.time - self._requested_at <= self.walker.silence and not self._error
        goal = Twist(*(self._requested.get(name, 0.0) if fresh and not self._idle else 0.0 for name in AXES))
        goal = _RUNAWAY if self._runs_away else goal
        share = min(1.0, dt / _LAG)
        self.twist = Twist(
            *(now + (wanted - now) * share for now, wanted in zip(self.twist, goal, strict=True))
        )
        if not stands:
            self.twist = Twist()
            return
        self._enter(BodyMode.WALKING if any(abs(each) > 0.01 for each in self.twist) else BodyMode.STANDING)
        x, y, yaw = self.place
        cos, sin = math.cos(yaw), math.sin(yaw)
        forward, left, turn = self.twist
        self.place = (
            x + (cos * forward - sin * left) * dt,
            y + (sin * forward + cos * left) * dt,
            yaw + turn * dt,
        )

    def _send(self, frames: tuple[FrameMap, ...]) -> None:
        values = self._values()
        for frame in frames:
            data, integrity = encode(frame, values), self._integrity.get(frame.id)
            self._say(CanFrame(frame.id, integrity.put(data) if integrity else data))

    def _values(self) -> dict[str, float]:
        """Return all values that such a machine can report."""
        alike = self.mode if self.mode in self._numbers else _ALIKE.get(self.mode, BodyMode.OFF)
        yaw = self.place[2]
        lean = Quaternion(math.cos(self._tilt / 2), math.sin(self._tilt / 2), 0.0, 0.0)
        turn = lean if self._tilt else quaternion_from_yaw(yaw)
        return {
            "mode": self._numbers[alike],
            "error": self._error,
            **dict(zip(AXES, self.twist, strict=True)),
            "yaw": math.remainder(yaw, math.tau),
            "height": self.height,
            "qw": turn.w,
            "qx": turn.x,
            "qy": turn.y,
            "qz": turn.z,
            "gx": 0.0,
            "gy": 0.0,
            "gz": self.twist.turn,
            "ax": 0.0,
            "ay": 0.0,
            "az": GRAVITY,
            "percent": self.percent,
            "voltage": 44.0 + self.percent * 0.06,
            "current": 3.0,
        }

    def _say(self, frame: CanFrame) -> None:
        """Send a frame."""
        for arrived in () if self._muted else self._wires.from_dog(self.walker.bus, [frame], self.time):
            self._heard(arrived)

    # -- as a CANopen node ---------------------------------------------------------------------------

    def _server(self) -> SdoServer | None:
        """Return the object dictionary with all objects of the description; None for other machines."""
        objects = self.walker.objects
        if objects is None:
            return None
        places = {(item.place, item.sub): (item.size, 0) for item in self._wire.setup}
        for frame in self._wire.commands.values():
            index = int.from_bytes(frame.data[1:3], "little")
            places[index, frame.data[3]] = (4 - (frame.data[0] >> 2 & 3), 0)
        if objects.height is not None:
            entry = objects.height
            places[entry.index, entry.sub] = (entry.at(0).layout.size, 0)
        return SdoServer(objects.node, places, self._say)

    def _runs(self) -> bool:
        """Return True if velocities are accepted: a CANopen node must be configured and started."""
        return self.sdo is None or self._nmt == OPERATIONAL

    def _serve(self, frame: CanFrame) -> None:
        """Act as a node: SDO, NMT, SYNC."""
        assert self.sdo is not None
        objects, node = self.walker.objects, self._wire.node
        if frame.id == SYNC and self._runs():
            self._syncs += 1
            self._send(self._wire.state)
            if self._syncs % 10 == 0:
                self._send(self._wire.slow)
        elif frame.id == 0x000 and len(frame.data) == 2 and frame.data[1] in {0, node}:
            started = frame.data[0] == 1 and self._is_mapped()
            self._nmt = OPERATIONAL if started else _PRE_OPERATIONAL
        elif frame.id == SDO_REQUEST + (node or 0):
            self.sdo.handle_frame(frame)
            if objects is not None and objects.height is not None:
                entry = objects.height
                raw = self.sdo.objects[entry.index, entry.sub].value
                self.height = raw * entry.scale + entry.offset if raw else self.height

    def _is_mapped(self) -> bool:
        """Return True if its PDOs are mapped as in the description."""
        assert self.sdo is not None
        entries = self.sdo.objects
        return all(
            entries[item.place, item.sub].value == item.value for item in final_values(list(self._wire.setup))
        )
