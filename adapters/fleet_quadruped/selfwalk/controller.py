"""One cycle of a machine that walks by itself: read, check, limit, send a velocity. No clock of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fleet import CanBus, CanFrame, LinkLost, quaternion_from_yaw
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.machine import BodyRequest
from fleet_quadruped.body.measured import Imu
from fleet_quadruped.body.velocity_ramp import limited, ramped
from fleet_quadruped.can.bus_guard import Address
from fleet_quadruped.control.lamp import Lamp
from fleet_quadruped.control.orders import DogState, Order, Timing
from fleet_quadruped.control.sensors import Values, imu_of
from fleet_quadruped.drives.cia402.commission import NodeName, write_node
from fleet_quadruped.drives.cia402.frames import SDO_RESPONSE
from fleet_quadruped.frame_integrity import Seal
from fleet_quadruped.frames import FrameEncoder
from fleet_quadruped.safety.stages import EMERGENCY_STOP, TOLD_TO_LEAVE, Mode
from fleet_quadruped.selfwalk.by_objects import SDO_ABORT
from fleet_quadruped.selfwalk.description import SelfWalker
from fleet_quadruped.selfwalk.obedience import Obedience
from fleet_quadruped.selfwalk.requests import NAMES, TAKEN, RequestTracker
from fleet_quadruped.selfwalk.wire import AXES

_STANDS = frozenset({Mode.STANDING, Mode.WALKING})
_LOOSE = frozenset({Mode.OFF, Mode.DAMPED})
_GONE = 2.0  # s of silence after which the link counts as lost
_AT_LEAST = 0.2  # s for which an emergency stop is repeated
_STILL = Twist()


class SelfWalkController:
    """A machine under control: ``begin`` greets it, ``take`` hears it, ``finish`` tells it how to walk."""

    def __init__(self, walker: SelfWalker, buses: Mapping[str, CanBus]) -> None:
        self.walker = walker
        self.dt = walker.dt
        self.clamped = 0
        self.mode = Mode.OFF
        self.fault = ""
        self._bus = buses[walker.bus]
        self._wire = walker.wire
        state, slow = walker.sensors()
        self._state = Values(state)
        self._slow = Values(slow) if slow else None
        self._lamp = Lamp(walker.led, buses)
        self._asks = RequestTracker()
        self._seals = {number: Seal(number, sealed) for number, sealed in self._wire.seals.items()}
        self._velocities = [(frame.id, FrameEncoder(frame)) for frame in self._wire.velocity]
        self._obedience = Obedience()
        self._errand = self._stops = 0
        self._stopping = False  # an emergency stop that the machine has not obeyed yet
        self._stop_until = -math.inf
        self._sit_at = -math.inf
        self._since: float | None = None
        self._began = self._now = 0.0
        self._error = self._unnamed = ""  # what it says: an error, a mode that its description does not name
        self._twist = Twist()
        self._x = self._y = self._yaw = 0.0
        self._height = walker.height
        self._imu: Imu | None = None

    @property
    def addresses(self) -> frozenset[Address]:
        """The frames of the velocity, which only one controller may send."""
        return frozenset((self.walker.bus, frame.id) for frame in self._wire.velocity)

    def configure(self) -> None:
        """Write and read back what a CANopen machine needs, and send what starts any other.

        Raises LinkLost for one that does not answer, LinkRefused naming object, wanted and actual.
        """
        if self._wire.node is not None:
            who = NodeName(self.walker.robot.name, self.walker.bus, self._wire.node)
            write_node(self._bus, who, list(self._wire.setup))
        for frame in self._wire.start:
            self._put(frame)

    @property
    def resting(self) -> bool:
        """True when it may be left alone."""
        return self.mode in _LOOSE and not self._unnamed

    @property
    def oldest(self) -> float:
        """Age of its state, s."""
        return self._state.age(self._now)

    def begin(self, now: float) -> None:
        """Begin a cycle: a CANopen machine is told that we live, and asked for its state."""
        self._began = now
        for frame in self._wire.alive:
            self._bus.send(frame)

    def complete(self) -> bool:
        """Return True when nothing more is waited for; a machine that speaks when it likes is not."""
        return not self._wire.alive or self._state.age(self._began) <= 0.0

    def take(self, bus: str, frame: CanFrame, now: float) -> None:
        """Take a received frame."""
        for told in (self._state, self._slow):
            if told is not None and (bus, frame.id) in told.frames:
                told.take(frame, now)
        node = self._wire.node
        if node is not None and frame.id == SDO_RESPONSE + node and frame.data[:1] == bytes([SDO_ABORT]):
            code = int.from_bytes(frame.data[4:8], "little")
            self._asks.end(f"the machine refuses the object (SDO abort {code:08X}h)")

    def finish(self, now: float, dt: float, order: Order) -> None:
        """End a cycle; raises LinkLost when the machine is silent for too long."""
        self._now = self._began  # what came later was read: our own stall is not the machine's silence
        self._since = self._began if self._since is None else self._since
        self._look(dt)
        self._check(self._began)
        self._judge(dt)
        self._obey(order, now)
        self._send(self._next(now, dt, order))
        emergency = self._wire.commands["emergency_stop"]
        if self._is_stopping(now):
            self._put(emergency)
        elif (frame := self._asks.step(now, self.mode, self._error)) is not None:
            self._put(frame)
        self._lamp.show(order.lamp)

    def abandon(self) -> None:
        """Have it stand still, if it can still be reached: nobody follows."""
        self._send(_STILL)

    def state(self, now: float, timing: Timing) -> DogState:
        """Return the newest state."""
        turn = self._imu.rotation if self._imu else quaternion_from_yaw(self._yaw)
        gyro, accel = (self._imu.gyro, self._imu.accel) if self._imu else (None, None)
        return DogState(
            stamp=now,
            mode=self.mode.value,
            fault=self.fault,
            warning=self._warning(),
            answered=self._asks.answered,
            refusal=self._asks.refusal,
            stopped=self._stops,
            posed=self._now - self._state.age(self._now),
            felt=self._now - self._state.age(self._now),
            x=self._x,
            y=self._y,
            height=self._state.values.get("height", self._height),
            twist=tuple(self._seen()),
            rotation=(turn.w, turn.x, turn.y, turn.z),
            gyro=(gyro.x, gyro.y, gyro.z) if gyro else None,
            accel=(accel.x, accel.y, accel.z) if accel else None,
            battery=dict(self._slow.values) if self._slow else {},
            battery_age=self._slow.age(now) if self._slow and self._slow.values else None,
            loads=self.walker.loads,
            timing=timing,
        )

    # -- what is seen --------------------------------------------------------------------------------

    def _look(self, dt: float) -> None:
        """Take over what the machine has told."""
        values = self._state.values
        if self._is_stale():
            return
        number = round(values.get("mode", -1))
        self.mode = self.walker.modes.get(number, Mode.OFF)
        known = number in self.walker.modes
        self._unnamed = "" if known else f"it says mode {number}, which modes does not name"
        error = round(values.get("error", 0))
        self._error = f"{self.walker.errors.get(error, 'error')} (error {error})" if error else ""
        self._imu = imu_of(values)
        seen = self._seen()
        self._yaw = self._imu.rotation.yaw if self._imu else values.get("yaw", self._yaw + seen.turn * dt)
        cos, sin = math.cos(self._yaw), math.sin(self._yaw)
        self._x += (cos * seen.x - sin * seen.y) * dt
        self._y += (sin * seen.x + cos * seen.y) * dt

    def _seen(self) -> Twist:
        """Return the velocity that it tells."""
        return Twist(*(self._state.values.get(name, 0.0) for name in AXES))

    def _is_stale(self) -> bool:
        return self._state.age(self._now) > self.walker.timeout

    def _check(self, now: float) -> None:
        """Latch faults; raises LinkLost for a machine that is gone."""
        age = min(self._state.age(now), now - (self._since or 0.0))
        if age > _GONE:
            raise LinkLost(f"{self.walker.robot.name} is silent on bus {self.walker.bus!r} for {age:.1f} s")
        if self._error:
            self.fault = self.fault or f"{self.walker.robot.name}: {self._error}"
        if age > self.walker.timeout and self.mode in _STANDS:
            self.fault = self.fault or f"{self.walker.robot.name}: no state for {age:.2f} s"
        if self._imu is not None and self.mode in _STANDS:
            tilt, most = self._imu.tilt, self.walker.safety.tilt
            if tilt > most:
                self._stop(f"imu: tilted {tilt:.2f} rad, more than {most:g}", now)

    def _judge(self, dt: float) -> None:
        """Compare what it tells with what it was asked; one that walks unasked is stopped."""
        known = self.mode in _STANDS and not self._is_stale()
        self._obedience.judge(dt, self._twist if known else _STILL, self._seen() if known else _STILL)
        if self._obedience.runs:
            self._stop(f"{self.walker.robot.name}: {self._obedience.runs}", self._now)

    def _warning(self) -> str:
        if self._unnamed or self._obedience.why:
            return self._unnamed or f"{self.walker.robot.name}: {self._obedience.why}"
        percent = self._percent()
        return f"battery at {percent:.0f} %" if percent is not None and percent <= self.walker.warn else ""

    def _percent(self) -> float | None:
        """Return the battery's percent while it is fresh."""
        slow = self._slow
        return slow.values.get("percent") if slow and slow.age(self._now) < self.walker.slow_timeout else None

    # -- what is done --------------------------------------------------------------------------------

    def _obey(self, order: Order, now: float) -> None:
        """Take what is asked, then stops, which so have the last word, then the absence of whoever asks."""
        activity = order.activity
        if activity.number > self._errand:
            self._errand = activity.number
            self._asks.begin(activity.number, activity.ask, *self._answer(activity.ask, activity.value), now)
        if order.stop > self._stops:
            self._stops, self._stopping = order.stop, True
            self._stop(EMERGENCY_STOP, now)
        silent = now - order.alive
        if order.leave or silent > self.walker.safety.abandoned:
            self._sit(TOLD_TO_LEAVE if order.leave else f"nothing heard from its host for {silent:.0f} s")
        percent = self._percent()
        if percent is not None and percent <= self.walker.sit_at:
            self._sit(f"battery: {percent:.0f} %, it sits down at {self.walker.sit_at:g} %")

    def _answer(self, ask: BodyRequest, value: float) -> tuple[CanFrame | None, str]:
        """Return the frame that carries out an ask, and why it is refused, empty when it is not."""
        if ask is BodyRequest.HEIGHT:
            return self._raise(value)
        frame = self._wire.commands.get(NAMES[ask])
        if ask is BodyRequest.RESET:
            if self._stopping:
                return None, "it has not obeyed the emergency stop yet"
            self.fault = ""
            return frame, ""
        if frame is None:
            return None, f"this machine's description has no {NAMES[ask]}"
        if ask is BodyRequest.SIT:
            return frame, ""
        refusal = self._not_now(ask)
        return (None, refusal) if refusal else (frame, "")

    def _not_now(self, ask: BodyRequest) -> str:
        """Return why it cannot get up now; what the host lets through ends an emergency stop."""
        if self._is_stale():
            return "the machine tells no state"
        if self.mode is not Mode.OFF and self.mode not in TAKEN[ask]:
            return f"it is {self.mode.value}"
        if self.fault == EMERGENCY_STOP:
            self.fault = ""
        return self.fault and f"a fault is latched: {self.fault}; look at the machine, then send reset_faults"

    def _raise(self, value: float) -> tuple[CanFrame | None, str]:
        """Return the frame for another height."""
        if self._wire.height is None:
            return None, "this machine's description has no height"
        if self.mode not in _STANDS:
            return None, f"it is {self.mode.value}; stand up first"
        self._height = max(self.walker.lowest, min(self.walker.highest, self._height + value))
        return self._wire.height(self._height), ""

    def _stop(self, cause: str, now: float) -> None:
        """Stop as hard as the machine can, and latch why; what was latched before needs its reset still."""
        self.fault = self.fault or cause
        self._stop_until = max(self._stop_until, now + _AT_LEAST)
        self._asks.end(cause)

    def _is_stopping(self, now: float) -> bool:
        """Return True while the stop is repeated: for a moment, an emergency stop until it was obeyed."""
        if now < self._stop_until:
            return True
        self._stopping = self._stopping and not self.resting
        return self._stopping

    def _sit(self, cause: str) -> None:
        """Sit down while it stands; the command is repeated until it does."""
        if self.mode in _STANDS or self.mode is Mode.RISING:
            self.fault = self.fault or cause
            if self._now >= self._sit_at:
                self._sit_at = self._now + _AT_LEAST
                self._put(self._wire.commands["sit_down"])

    def _next(self, now: float, dt: float, order: Order) -> Twist:
        """Return the velocity of this cycle."""
        if self.fault or self.mode not in _STANDS or self._is_stopping(now):
            self._twist = _STILL
            return _STILL
        moving = now < order.until and now - order.alive < self.walker.safety.deadman
        wanted = order.twist if moving else _STILL
        within = limited(wanted, self.walker.pace)
        self.clamped += within != wanted
        self._twist = ramped(self._twist, within, self.walker.pace, dt)
        return self._twist

    def _send(self, twist: Twist) -> None:
        """Send a velocity."""
        values = dict(zip(AXES, twist, strict=True))
        for number, encoder in self._velocities:
            self._put(CanFrame(number, encoder.encode(values)))

    def _put(self, frame: CanFrame) -> None:
        """Put a frame on the bus, with its counter and checksum."""
        seal = self._seals.get(frame.id)
        self._bus.send(CanFrame(frame.id, seal.put(frame.data)) if seal else frame)
