"""The quadruped as the fleet sees it: commands to orders, states to reports."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Annotated

import msgspec

from fleet import (
    ZERO_VELOCITY,
    Adapter,
    Fault,
    Health,
    JointRange,
    Level,
    Limits,
    LinkLost,
    NotReady,
    Progress,
    Range,
    Refused,
    Robot,
    Separation,
    TimedOut,
    Unsupported,
    Velocity,
    command,
    photograph,
)
from fleet_quadruped.any_description import AnyBody, load_body
from fleet_quadruped.body.machine import BodyRequest
from fleet_quadruped.body.posing import window
from fleet_quadruped.config import QuadrupedConfig
from fleet_quadruped.control.orders import Activity, DogState, Order
from fleet_quadruped.process import BodyProcess
from fleet_quadruped.reports import MotionReports, health_of, new_origin, slow_reports
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS

__all__ = ["QuadrupedAdapter", "QuadrupedConfig"]

_FOREVER = 3600.0  # s: the host ends velocities; our own dead-man watches the host
_ALIVE, _LOOK, _MOTION, _SLOW = 0.1, 0.02, 0.05, 1.0  # s between two of them
_SILENT = 1.0  # s without a state after which the body controller counts as frozen
_EMERGENCY = "emergency_stop"
_LAMP = "lamp"  # the key of ``robot.state``: what was asked of the lamp outlives the body controller
Condition = Callable[[], bool]
_Height = Annotated[float, Range(-1.0, 1.0, "m")]  # the word says up or down; the body bounds it further
_POSING = "posing"
_LED = 0.3  # s that the body leads joints on after it was told to
_STANDS = frozenset({"standing", "walking"})
_STILL = frozenset({"standing", "held", "off", "damped"})
_RECOVERING = "recovering"
_ANSWERED = _STILL | {_RECOVERING}  # where a plain stop ends, or needs something more
_STOPPED = 4.5  # s until it must stand still; the host waits half a second longer


class QuadrupedAdapter(Adapter[QuadrupedConfig]):
    """A dog that walks: its body controller is a process of its own, started by ``run``."""

    Config = QuadrupedConfig
    limits = Limits(speed=0.8, yaw_rate=1.0)
    separation = Separation(radius=0.6, braking=1.0, precedence=1)
    holonomic = True
    failsafe = "its body controller, a process of its own, stops the dog; the drives stop without it"

    def __init__(self, config: QuadrupedConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        self._order = Order(lamp=robot.state.get(_LAMP))
        self._ordering = threading.Lock()  # halts come from other threads; held for an instant
        self._state = DogState()
        self._motion = MotionReports(config.trim)
        self._origin = 0.0  # Unix s at which odometry began
        self._heard = 0.0  # monotonic s: the newest state, or the start
        self._news = asyncio.Event()
        self._one_errand = asyncio.Lock()
        self._serves = True  # its body controller runs
        self._dog: AnyBody
        self._body: BodyProcess

    async def connect(self) -> None:
        """Start the body controller; raises LinkLost or LinkRefused."""
        robot = self.robot
        robot.health(Health(Level.OFFLINE, "its body controller has told no state yet"))
        self._dog = load_body(self.config.body_file)
        self._body = await robot.enter(BodyProcess(self.config, self._dog.leave_time))
        self._heard, self._origin = self._now(), robot.clock.time()
        robot.report(new_origin(self._origin))
        self._send()
        robot.every(_ALIVE, self._send)
        robot.every(_LOOK, self._look)
        robot.every(_MOTION, self._report_motion)
        robot.every(_SLOW, self._report_slow)

    async def run(self) -> None:
        """Wait until the body controller ends; raises LinkLost or LinkRefused with what it said."""
        try:
            await self._body.ended()
        finally:
            self._serves = False

    def drive(self, velocity: Velocity) -> None:
        """Walk like this from now on; only a dog that stands walks."""
        if self._state.mode not in _STANDS and not velocity.is_zero:
            raise NotReady(f"the dog is {self._state.mode}", hint="send stand_up first")
        self._change(_walking(velocity, self._now()))

    async def stop(self, reason: str) -> None:
        """Stand still; for an emergency stop give way with damping and go off, seen to be done.

        A dog that recovers cannot stand still: it gives way where it lies.
        """
        if not self._serves:
            return
        if reason == _EMERGENCY:
            self.emergency_halt()
            number = self._order.stop
            await self._until(lambda: self._state.stopped >= number, "the emergency stop")
            return
        self.halt()
        await self._until(lambda: self._state.mode in _ANSWERED, "standing still", within=_STOPPED)
        if self._state.mode == _RECOVERING:
            with contextlib.suppress(Refused):  # it has just come to its feet
                await self._errand(BodyRequest.SIT)
            await self._until(lambda: self._state.mode in _STILL, "standing still", within=_STOPPED)

    def halt(self) -> None:
        """Order to stand still, in the posture that it has; from any thread."""
        self._change(_still(self._now()), halts=1)

    def emergency_halt(self) -> None:
        """Order to give way with damping and go off, in the next cycle; from any thread."""
        self._change(_still(self._now()), stops=1, halts=1)

    # -- joints --------------------------------------------------------------------------------------

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return its joints, in joint_mode no farther than they are led from its posture."""
        dog = self._dog
        if not isinstance(dog, DogDescription):  # a machine that walks by itself
            return {}
        margin, speed = dog.safety.margin, dog.safety.joint_speed
        bounds = tuple((joint.low + margin, joint.high - margin) for joint in dog.all_joints)
        if self._state.posture:
            bounds = window(dog, self._state.posture)
        return {name: JointRange(low, high, speed) for name, (low, high) in zip(JOINTS, bounds, strict=True)}

    def move_joints(self, targets: Mapping[str, float]) -> None:
        """Lead joints there; only a dog in joint_mode is led."""
        if self._state.mode != _POSING:
            raise NotReady(f"the dog is {self._state.mode}", hint="send joint_mode first")
        goal = tuple(targets.get(name) for name in JOINTS)
        self._change({"joints": goal, "joints_until": self._now() + _LED})

    def hold_joints(self) -> None:
        """Order to hold the joints where they are; joint_mode goes on. From any thread."""
        self._change({"joints": ()})

    # -- commands ------------------------------------------------------------------------------------

    @command("stand_up", timeout=8.0)
    async def stand_up(self, *, delta_z: _Height | None = None) -> AsyncIterator[Progress]:
        """Stand up; with delta_z (m): stand that much higher."""
        async for progress in self._rise_or_lower(delta_z, up=True):
            yield progress

    @command("sit_down", timeout=12.0)
    async def sit_down(self, *, delta_z: _Height | None = None) -> AsyncIterator[Progress]:
        """Sit down and take the torque off; with delta_z (m): stand that much lower."""
        async for progress in self._rise_or_lower(delta_z, up=False):
            yield progress

    @command("joint_mode", timeout=5.0)
    async def joint_mode(self) -> AsyncIterator[Progress]:
        """Hold the posture that it has, and let its joints be led a little from it, until any stop."""
        if self._dog is not None and not isinstance(self._dog, DogDescription):
            raise Unsupported("this machine moves its joints by itself")
        await self._errand(BodyRequest.POSE)
        yield Progress(0.0)
        await self._until(lambda: self._state.mode == _POSING or self._off(), "joint_mode", within=4.0)
        if self._off():
            raise Fault(self._state.fault or f"it is {self._state.mode}")

    @command("recovery_stand", timeout=30.0)
    async def recovery_stand(self) -> AsyncIterator[Progress]:
        """Get up from whatever it lies on."""
        await self._errand(BodyRequest.RECOVER)
        yield Progress(0.0)
        await self._standing()

    @command("reset_faults", timeout=3.0, moves=False)
    async def reset_faults(self) -> None:
        """Acknowledge latched faults, after a person has looked at the dog."""
        await self._errand(BodyRequest.RESET)

    @command("led_toggle", timeout=2.0, moves=False)
    async def led_toggle(self, *, enabled: bool | None = None) -> None:
        """Turn the lamp on or off; without data, the other way round."""
        if self._dog.led is None:
            raise Unsupported("this dog's description has no led")
        lamp = not self._order.lamp if enabled is None else enabled
        self.robot.state[_LAMP] = lamp
        self._change({"lamp": lamp})

    @command("battery_check", timeout=2.0, moves=False)
    async def battery_check(self) -> None:
        """Report the battery now."""
        timeout = self._dog.battery_timeout
        if timeout is None:
            raise Unsupported("this dog's description has no battery")
        if self._state.battery_age is None or self._state.battery_age > timeout:
            raise NotReady("the battery says nothing", hint="check its CAN frames")
        for report in slow_reports(self._state, self.robot.clock.time(), self._origin):
            self.robot.report(report)

    @command("take_photo", timeout=10.0, moves=False, safe=True)
    async def take_photo(self) -> None:
        """Publish a picture of the configured camera."""
        self.robot.report(await photograph(self.config.camera, self.robot.clock))

    async def _rise_or_lower(self, delta_z: float | None, *, up: bool) -> AsyncIterator[Progress]:
        """Change the height, or all of the posture."""
        if delta_z is not None:
            await self._errand(BodyRequest.HEIGHT, abs(delta_z) if up else -abs(delta_z))
            yield Progress(0.0)
            await asyncio.sleep(0)
            return
        await self._errand(BodyRequest.STAND if up else BodyRequest.SIT)
        yield Progress(0.0)
        await (self._standing() if up else self._lying())

    async def _standing(self) -> None:
        """Wait until the dog was seen to stand; raises Fault when it went off instead."""
        await self._until(lambda: self._state.mode in _STANDS or self._off(), "standing up", within=29.0)
        if self._off():
            raise Fault(self._state.fault or f"it is {self._state.mode}")

    async def _lying(self) -> None:
        await self._until(lambda: self._state.mode == "off", "sitting down", within=11.0)
        if self._state.fault:
            raise Fault(self._state.fault)

    def _off(self) -> bool:
        return self._state.mode in {"off", "damped"}

    async def _errand(self, ask: BodyRequest, value: float = 0.0) -> None:
        """Ask the body for something; raises Refused with its reason."""
        async with self._one_errand:
            number = self._order.activity.number + 1
            self._change({"activity": Activity(number, ask, value)})
            await self._until(lambda: self._state.answered >= number, ask.value)
            if self._state.refusal:
                raise Refused(self._state.refusal)

    async def _until(self, condition: Condition, what: str, within: float = 2.0) -> None:
        """Wait for a state; raises TimedOut."""
        try:
            async with asyncio.timeout(within):
                while not condition():
                    self._news.clear()
                    await self._news.wait()
        except TimeoutError:
            raise TimedOut(f"{what}: the dog is {self._state.mode} after {within:g} s") from None

    # -- the body ------------------------------------------------------------------------------------

    def _send(self) -> None:
        """Send the newest order again; that it is fresh is what keeps the dog walking."""
        self._change({})

    def _change(self, changes: Mapping[str, object], *, stops: int = 0, halts: int = 0) -> None:
        """Change and send the order, whole, from any thread; so many stops are added."""
        with self._ordering:
            counted = {"stop": self._order.stop + stops, "halts": self._order.halts + halts}
            self._order = msgspec.structs.replace(self._order, **changes, **counted, alive=self._now())
            self._body.orders.put(self._order)

    def _now(self) -> float:
        """Return monotonic seconds, which are the same in the body controller's process."""
        return self.robot.clock.monotonic()

    def _look(self) -> None:
        """Take the newest state; raises LinkLost when the body controller tells none any more."""
        before = self._state
        self._state = self._body.states.get()
        self._check_alive()
        if self._state is not before and self._state.stamp:  # before the first state nothing is known
            self._news.set()
            health = health_of(self._state, 1.0 / self._dog.dt)
            if before.stamp == 0.0 or health != health_of(before, 1.0 / self._dog.dt):
                self.robot.health(health)

    def _check_alive(self) -> None:
        """Say at once that the body controller is frozen, and end the run; raises LinkLost."""
        self._heard = max(self._heard, self._state.stamp)
        silent = self._now() - self._heard
        if silent > _SILENT:
            cause = f"the body controller is frozen: it has told nothing for {silent:.1f} s"
            self.robot.health(Health(Level.OFFLINE, cause))
            raise LinkLost(cause)

    def _report_motion(self) -> None:
        if self._state.stamp:
            clock = self.robot.clock
            for report in self._motion.reports(self._state, clock.time() - clock.monotonic()):
                self.robot.report(report)

    def _report_slow(self) -> None:
        if self._state.stamp:
            for report in slow_reports(self._state, self.robot.clock.time(), self._origin):
                self.robot.report(report)


def _still(now: float) -> dict[str, object]:
    """Return what any stop changes in the order."""
    return {**_walking(ZERO_VELOCITY, now), "joints": ()}


def _walking(velocity: Velocity, now: float) -> dict[str, object]:
    """Return what a velocity changes in the order, at the monotonic time ``now``."""
    move, gait = velocity.linear, "walk" if velocity.gait == "walk" else "trot"
    return {"x": move.x, "y": move.y, "turn": velocity.yaw_rate, "gait": gait, "until": now + _FOREVER}
