"""Control cycle of a self-walking machine: receive, check, limit, send a velocity. It has no clock."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fleet import CanBus, CanFrame, LinkLost
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.body.velocity_ramp import limited, ramped
from fleet_quadruped.can.bus_guard import BusAddress
from fleet_quadruped.control.lamp import Lamp
from fleet_quadruped.control.orders import DogState, LoopTiming, Order
from fleet_quadruped.drives.cia402.commission import NodeName, write_node
from fleet_quadruped.drives.cia402.frames import SDO_RESPONSE
from fleet_quadruped.safety.stages import EMERGENCY_STOP, REQUESTED_TO_LEAVE, BodyMode
from fleet_quadruped.selfwalk.by_objects import SDO_ABORT
from fleet_quadruped.selfwalk.description import SelfWalker
from fleet_quadruped.selfwalk.height import StandingHeight
from fleet_quadruped.selfwalk.requests import NAMES, TAKEN, RequestTracker
from fleet_quadruped.selfwalk.sender import FrameSender
from fleet_quadruped.selfwalk.stop_repeat import StopRepeat
from fleet_quadruped.selfwalk.telemetry import Telemetry
from fleet_quadruped.selfwalk.velocity_check import VelocityCheck

_STANDS = frozenset({BodyMode.STANDING, BodyMode.WALKING})
_LOOSE = frozenset({BodyMode.OFF, BodyMode.DAMPED})
_GONE = 2.0  # s of silence after which the link is lost
_SIT_EVERY = 0.2  # s between two commands to sit down
_STILL = Twist()


class SelfWalkController:
    """Controls a self-walking machine: ``begin`` polls, ``handle_frame`` receives, ``finish`` decides."""

    def __init__(self, walker: SelfWalker, buses: Mapping[str, CanBus]) -> None:
        self.walker = walker
        self.dt = walker.dt
        self.clamped = 0
        self.fault = ""
        self._bus = buses[walker.bus]
        self._wire = walker.wire
        self._telemetry = Telemetry(walker)
        self._sender = FrameSender(self._bus, self._wire)
        self._lamp = Lamp(walker.led, buses)
        self._requests = RequestTracker()
        self._velocity_check = VelocityCheck()
        self._activity = self._stops = self._halted = 0
        self._stop_repeat = StopRepeat()
        self._sit_at = -math.inf
        self._since: float | None = None
        self._began = 0.0
        self._twist = Twist()
        self._height = StandingHeight(walker)

    @property
    def addresses(self) -> frozenset[BusAddress]:
        """Identifiers of the velocity, which only one controller may send."""
        return frozenset((self.walker.bus, frame.id) for frame in self._wire.velocity)

    def configure(self) -> None:
        """Write and verify the objects of a CANopen machine; send the start frames of any other.

        Raises LinkLost if it does not answer, LinkRefused with object, expected and actual value.
        """
        if self._wire.node is not None:
            who = NodeName(self.walker.robot.name, self.walker.bus, self._wire.node)
            write_node(self._bus, who, list(self._wire.setup))
        for frame in self._wire.start:
            self._sender.put(frame)

    @property
    def resting(self) -> bool:
        """True when the process may end."""
        return self._telemetry.mode in _LOOSE

    @property
    def oldest(self) -> float:
        """Age of its state, s."""
        return self._telemetry.age(self._telemetry.now)

    def begin(self, now: float) -> None:
        """Begin a cycle: send heartbeat and SYNC to a CANopen machine."""
        self._began = now
        for frame in self._wire.alive:
            self._bus.send(frame)

    def complete(self) -> bool:
        """Return True when all feedback of this cycle has arrived; an unpolled machine owes none."""
        return not self._wire.alive or self._telemetry.age(self._began) <= 0.0

    def handle_frame(self, bus: str, frame: CanFrame, now: float) -> None:
        """Process a received frame."""
        self._telemetry.handle_frame(bus, frame, now)
        node = self._wire.node
        if node is not None and frame.id == SDO_RESPONSE + node and frame.data[:1] == bytes([SDO_ABORT]):
            code = int.from_bytes(frame.data[4:8], "little")
            self._requests.end(f"the machine refuses the object (SDO abort {code:08X}h)")

    def finish(self, now: float, dt: float, order: Order) -> None:
        """End a cycle; raises LinkLost if the machine is silent for too long."""
        self._since = self._began if self._since is None else self._since
        # Evaluate at the start of the cycle: frames that arrived later were read, so a stall of this process
        # does not count as silence of the machine.
        self._telemetry.update(self._began, dt)
        self._check(self._began)
        self._judge(dt)
        self._obey(order, now)
        self._sender.send(self._next(now, dt, order))
        emergency = self._wire.commands["emergency_stop"]
        if self._stop_repeat.active(now, resting=self.resting):
            self._sender.put(emergency)
        elif (frame := self._requests.step(now, self._telemetry.mode, self._telemetry.error)) is not None:
            self._sender.put(frame)
        self._lamp.show(order.lamp)

    def abandon(self) -> None:
        """Make it stand still, if it can still be reached: this controller ends without a successor."""
        self._sender.send(_STILL)

    def state(self, now: float, timing: LoopTiming) -> DogState:
        """Return the newest state."""
        telemetry = self._telemetry
        turn, imu = telemetry.rotation, telemetry.imu
        measured = telemetry.now - telemetry.age(telemetry.now)
        return DogState(
            stamp=now,
            mode=telemetry.mode.value,
            fault=self.fault,
            warning=self._warning(),
            answered=self._requests.answered,
            refusal=self._requests.refusal,
            stopped=self._stops,
            halted=self._halted,
            posed=measured,
            felt=measured,
            x=telemetry.x,
            y=telemetry.y,
            height=self._height.value if telemetry.height is None else telemetry.height,
            twist=tuple(telemetry.twist),
            rotation=(turn.w, turn.x, turn.y, turn.z),
            gyro=(imu.gyro.x, imu.gyro.y, imu.gyro.z) if imu else None,
            accel=(imu.accel.x, imu.accel.y, imu.accel.z) if imu else None,
            battery=telemetry.battery,
            battery_age=telemetry.battery_age(now),
            loads=self.walker.loads,
            timing=timing,
        )

    # -- inputs --------------------------------------------------------------------------------------

    def _check(self, now: float) -> None:
        """Latch faults; raises LinkLost for a machine that is silent."""
        age = min(self._telemetry.age(now), now - (self._since or 0.0))
        if age > _GONE:
            raise LinkLost(f"{self.walker.robot.name} is silent on bus {self.walker.bus!r} for {age:.1f} s")
        if self._telemetry.error:
            self.fault = self.fault or f"{self.walker.robot.name}: {self._telemetry.error}"
        if age > self.walker.timeout and self._telemetry.mode in _STANDS:
            self.fault = self.fault or f"{self.walker.robot.name}: no state for {age:.2f} s"
        if self._telemetry.imu is not None and self._telemetry.mode in _STANDS:
            tilt, most = self._telemetry.imu.tilt, self.walker.safety.tilt
            if tilt > most:
                self._stop(f"imu: tilted {tilt:.2f} rad, more than {most:g}", now)

    def _judge(self, dt: float) -> None:
        """Compare the reported velocity with the requested one; stop a machine that moves unrequested."""
        known = self._telemetry.mode in _STANDS and not self._telemetry.is_stale
        self._velocity_check.check_cycle(
            dt, self._twist if known else _STILL, self._telemetry.twist if known else _STILL
        )
        if self._velocity_check.runs:
            self._stop(f"{self.walker.robot.name}: {self._velocity_check.runs}", self._telemetry.now)

    def _warning(self) -> str:
        if self._telemetry.unnamed or self._velocity_check.why:
            return self._telemetry.unnamed or f"{self.walker.robot.name}: {self._velocity_check.why}"
        percent = self._telemetry.percent
        return f"battery at {percent:.0f} %" if percent is not None and percent <= self.walker.warn else ""

    # -- outputs -------------------------------------------------------------------------------------

    def _obey(self, order: Order, now: float) -> None:
        """Execute the activity, then the stop, which so takes precedence, then sit down without a host."""
        activity = order.activity
        if activity.number > self._activity:
            self._activity = activity.number
            self._requests.begin(
                activity.number, activity.request, *self._answer(activity.request, activity.value), now
            )
        if order.stop > self._stops:
            self._stops, self._stop_repeat.pending = order.stop, True
            self._stop(EMERGENCY_STOP, now)
        self._halted = order.halts
        silent = now - order.alive
        if order.leave or silent > self.walker.safety.abandoned:
            self._sit(REQUESTED_TO_LEAVE if order.leave else f"no contact with its host for {silent:.0f} s")
        percent = self._telemetry.percent
        if percent is not None and percent <= self.walker.sit_at:
            self._sit(f"battery: {percent:.0f} %, it sits down at {self.walker.sit_at:g} %")

    def _answer(self, request: BodyRequest, value: float) -> tuple[CanFrame | None, str]:
        """Return the frame for a request, and the reason of a refusal, empty if it is accepted."""
        if request is BodyRequest.HEIGHT:
            return self._height.change(value, self._telemetry.mode)
        frame = self._wire.commands.get(NAMES[request])
        if request is BodyRequest.RESET:
            if self._stop_repeat.pending:
                return None, "it has not carried out the emergency stop yet"
            self.fault = ""
            return frame, ""
        if frame is None:
            return None, f"this machine's description has no {NAMES[request]}"
        if request is BodyRequest.SIT:
            return frame, ""
        refusal = self._not_now(request)
        return (None, refusal) if refusal else (frame, "")

    def _not_now(self, request: BodyRequest) -> str:
        """Return why it cannot get up now; a request that the host lets through clears an emergency stop."""
        if self._telemetry.is_stale:
            return "the machine reports no state"
        if self._telemetry.unnamed:
            return self._telemetry.unnamed
        if self._telemetry.mode is not BodyMode.OFF and self._telemetry.mode not in TAKEN[request]:
            return f"it is {self._telemetry.mode.value}"
        if self.fault == EMERGENCY_STOP:
            self.fault = ""
        return self.fault and f"a fault is latched: {self.fault}; look at the machine, then send reset_faults"

    def _stop(self, cause: str, now: float) -> None:
        """Send the machine's emergency stop, and latch the cause; an older fault stays latched."""
        self.fault = self.fault or cause
        self._stop_repeat.begin(now)
        self._requests.end(cause)

    def _sit(self, cause: str) -> None:
        """Sit down while it stands; the command is repeated until the mode changes."""
        if self._telemetry.mode in _STANDS or self._telemetry.mode is BodyMode.RISING:
            self.fault = self.fault or cause
            if self._telemetry.now >= self._sit_at:
                self._sit_at = self._telemetry.now + _SIT_EVERY
                self._sender.put(self._wire.commands["sit_down"])

    def _next(self, now: float, dt: float, order: Order) -> Twist:
        """Return the velocity to send in this cycle."""
        if (
            self.fault
            or self._telemetry.mode not in _STANDS
            or self._stop_repeat.active(now, resting=self.resting)
        ):
            self._twist = _STILL
            return _STILL
        moving = now < order.until and now - order.alive < self.walker.safety.deadman
        wanted = order.twist if moving else _STILL
        within = limited(wanted, self.walker.pace)
        self.clamped += within != wanted
        self._twist = ramped(self._twist, within, self.walker.pace, dt)
        return self._twist
