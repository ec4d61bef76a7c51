"""Adapter for quadrupeds: commands to orders of the body controller, states to reports."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from typing import Annotated, Any

from fleet import (
    ZERO_VELOCITY,
    Adapter,
    Fault,
    Health,
    JointRange,
    Level,
    Limits,
    NotReady,
    Progress,
    Range,
    Refused,
    Robot,
    Separation,
    Unsupported,
    Velocity,
    command,
    photograph,
)
from fleet_quadruped.any_description import AnyBody, load_body
from fleet_quadruped.body.posing import window
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.body_client import BodyClient
from fleet_quadruped.can.relay import received
from fleet_quadruped.config import QuadrupedConfig
from fleet_quadruped.process import BodyProcess
from fleet_quadruped.recorded import CHANNELS, TOLERANCE, RecordedDog
from fleet_quadruped.reports import BodyReporter
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import EMERGENCY_STOP

__all__ = ["QuadrupedAdapter", "QuadrupedConfig"]

_FOREVER = 3600.0  # s: the host ends velocities; the body's own dead-man monitors the host
# s: periods of orders, state checks, fast reports and slow reports
_ALIVE, _POLL_INTERVAL, _MOTION, _SLOW = 0.1, 0.02, 0.05, 1.0
_EMERGENCY = "emergency_stop"
_LAMP = "lamp"  # key in ``robot.state``: the requested lamp state
# the command gives the direction; the body limits the height further
_Height = Annotated[float, Range(-1.0, 1.0, "m")]
_POSING = "posing"
_LED = 0.3  # s for which the body follows a joint target after it was sent
_STANDS = frozenset({"standing", "walking"})
_STANDS_STILL = frozenset({"standing", "held"})
_RECOVERING = "recovering"
_STOPPED = 4.5  # s until it must stand still; the host waits half a second longer


class QuadrupedAdapter(Adapter[QuadrupedConfig]):
    """Controls a walking robot through its body controller, a process of its own that ``run`` monitors."""

    Config = QuadrupedConfig
    limits = Limits(speed=0.8, yaw_rate=1.0)
    separation = Separation(radius=0.6, braking=1.0, precedence=1)
    holonomic = True
    replayed_channels = CHANNELS
    replay_tolerance = TOLERANCE
    failsafe = "its body controller, a process of its own, stops the dog; the drives stop without it"

    def __init__(self, config: QuadrupedConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        self._body = BodyClient(robot, lamp=robot.state.get(_LAMP))
        self._reporter = BodyReporter(robot, config.trim, lambda: self._body.state)
        self._serves = True  # the body controller is running
        self._lies = frozenset({"off"})  # modes in which it lies and nothing moves it
        self._dog: AnyBody

    @staticmethod
    def replayed(config: Any, robot: Robot) -> RecordedDog | None:
        """Return the adapter for replays of recorded frames; None for a self-walking machine."""
        body = load_body(config.body_file)
        return RecordedDog(config, robot, body) if isinstance(body, DogDescription) else None

    async def connect(self) -> None:
        """Start the body controller; raises LinkLost or LinkRefused."""
        robot = self.robot
        robot.health(Health(Level.OFFLINE, "its body controller has not reported a state yet"))
        self._dog = load_body(self.config.body_file)
        if not isinstance(self._dog, DogDescription):  # a self-walking machine may stay damped
            self._lies |= {"damped"}
        frames = await robot.enter(received(self._dog.buses, robot.log))
        process = await robot.enter(BodyProcess(self.config, self._dog.leave_time, frames.relay))
        self._reporter.begin()
        self._body.begin(process, self._dog.dt, recorded=frames.wanted)
        robot.every(_ALIVE, self._body.send)
        robot.every(_POLL_INTERVAL, self._body.poll)
        robot.every(_MOTION, self._reporter.report_motion)
        robot.every(_SLOW, self._reporter.report_slow)

    async def run(self) -> None:
        """Wait until the body controller ends; raises LinkLost or LinkRefused with its last message."""
        try:
            await self._body.process.ended()
        finally:
            self._serves = False

    def drive(self, velocity: Velocity) -> None:
        """Walk with this velocity from now on; only a standing robot accepts one."""
        state = self._body.state
        if state.mode not in _STANDS and not velocity.is_zero:
            raise NotReady(f"the dog is {state.mode}", hint="send stand_up first")
        if state.stopped < self._body.order.stop and not velocity.is_zero:  # the state is from before it
            raise NotReady("the dog is carrying out an emergency stop", hint="send stand_up once it lies")
        self._body.change(_walking(velocity, self._body.now()))

    async def stop(self, reason: str) -> None:
        """Stand still; in an emergency stop damp the joints, then disable the drives. Return at the end.

        A robot in recovery cannot stand still: it sits down where it is.
        """
        if not self._serves:
            return
        if reason == _EMERGENCY:
            self.emergency_halt()
            number = self._body.order.stop
            await self._body.until(
                lambda: self._body.state.stopped >= number and self._body.state.mode in self._lies,
                "the emergency stop",
                within=_STOPPED,
            )
            return
        self.halt()
        number, still = self._body.order.halts, _STANDS_STILL | self._lies
        ended = still | {_RECOVERING}  # which needs a further request
        await self._body.until(
            lambda: self._body.state.halted >= number and self._body.state.mode in ended,
            "standing still",
            within=_STOPPED,
        )
        if self._body.state.mode == _RECOVERING:
            with contextlib.suppress(Refused):  # recovery ended in the meantime
                await self._body.request(BodyRequest.SIT)
            await self._body.until(lambda: self._body.state.mode in still, "standing still", within=_STOPPED)

    def halt(self) -> None:
        """Order the robot to stand still in its present posture; from any thread."""
        self._body.change(_still(self._body.now()), halts=1)

    def emergency_halt(self) -> None:
        """Order damping, then disabled drives, in the next cycle; from any thread."""
        self._body.change(_still(self._body.now()), stops=1, halts=1)

    # -- joints --------------------------------------------------------------------------------------

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return the ranges of the joints; in joint_mode limited to a window around its posture."""
        dog = self._dog
        if not isinstance(dog, DogDescription):  # a self-walking machine
            return {}
        margin, speed = dog.safety.margin, dog.safety.joint_speed
        bounds = tuple((joint.low + margin, joint.high - margin) for joint in dog.all_joints)
        if self._body.state.posture:
            bounds = window(dog, self._body.state.posture)
        return {name: JointRange(low, high, speed) for name, (low, high) in zip(JOINTS, bounds, strict=True)}

    def move_joints(self, targets: Mapping[str, float]) -> None:
        """Move joints towards the targets; only in joint_mode."""
        if self._body.state.mode != _POSING:
            raise NotReady(f"the dog is {self._body.state.mode}", hint="send joint_mode first")
        goal = tuple(targets.get(name) for name in JOINTS)
        self._body.change({"joints": goal, "joints_until": self._body.now() + _LED})

    def hold_joints(self) -> None:
        """Order the joints to hold where they are; joint_mode stays on. From any thread."""
        self._body.change({"joints": ()})

    # -- commands ------------------------------------------------------------------------------------

    @command("stand_up", timeout=8.0, in_place=True)
    async def stand_up(self, *, delta_z: _Height | None = None) -> AsyncIterator[Progress]:
        """Stand up; with delta_z (m): stand higher by that much."""
        async for progress in self._rise_or_lower(delta_z, up=True):
            yield progress

    @command("sit_down", timeout=12.0, in_place=True)
    async def sit_down(self, *, delta_z: _Height | None = None) -> AsyncIterator[Progress]:
        """Sit down and take the torque off; with delta_z (m): stand lower by that much."""
        async for progress in self._rise_or_lower(delta_z, up=False):
            yield progress

    @command("joint_mode", timeout=5.0, in_place=True)
    async def joint_mode(self) -> AsyncIterator[Progress]:
        """Hold the present posture and accept small joint moves around it, until any stop."""
        if self._dog is not None and not isinstance(self._dog, DogDescription):
            raise Unsupported("this machine moves its joints by itself")
        await self._body.request(BodyRequest.POSE)
        yield Progress(0.0)
        await self._body.reach({_POSING}, "joint_mode", within=4.0)

    @command("recovery_stand", timeout=30.0, in_place=True)
    async def recovery_stand(self) -> AsyncIterator[Progress]:
        """Get up from any position."""
        await self._body.request(BodyRequest.RECOVER)
        yield Progress(0.0)
        await self._body.reach(_STANDS, "standing up", within=29.0)

    @command("reset_faults", timeout=3.0, moves=False)
    async def reset_faults(self) -> None:
        """Acknowledge latched faults, after a person has inspected the robot."""
        await self._body.request(BodyRequest.RESET)

    @command("led_toggle", timeout=2.0, moves=False)
    async def led_toggle(self, *, enabled: bool | None = None) -> None:
        """Turn the lamp on or off; without data, toggle it."""
        if self._dog.led is None:
            raise Unsupported("this dog's description has no led")
        lamp = not self._body.order.lamp if enabled is None else enabled
        self.robot.state[_LAMP] = lamp
        self._body.change({"lamp": lamp})

    @command("battery_check", timeout=2.0, moves=False)
    async def battery_check(self) -> None:
        """Report the battery now."""
        timeout = self._dog.battery_timeout
        if timeout is None:
            raise Unsupported("this dog's description has no battery")
        if self._body.state.battery_age is None or self._body.state.battery_age > timeout:
            raise NotReady("no data from the battery", hint="check its CAN frames")
        self._reporter.report_slow()

    @command("take_photo", timeout=10.0, moves=False, safe=True)
    async def take_photo(self) -> None:
        """Publish a picture of the configured camera."""
        self.robot.report(await photograph(self.config.camera, self.robot.clock))

    async def _rise_or_lower(self, delta_z: float | None, *, up: bool) -> AsyncIterator[Progress]:
        """Change the height by delta_z, or stand up or sit down without it."""
        if delta_z is not None:
            await self._body.request(BodyRequest.HEIGHT, abs(delta_z) if up else -abs(delta_z))
            yield Progress(0.0)
            await asyncio.sleep(0)
            return
        await self._body.request(BodyRequest.STAND if up else BodyRequest.SIT)
        yield Progress(0.0)
        if up:
            await self._body.reach(_STANDS, "standing up", within=29.0)
            return
        await self._body.until(lambda: self._body.state.mode == "off", "sitting down", within=11.0)
        if self._body.state.fault not in {"", EMERGENCY_STOP}:  # after an emergency stop it lies already
            raise Fault(self._body.state.fault)


def _still(now: float) -> dict[str, object]:
    """Return the changes of the order that any stop makes."""
    return {**_walking(ZERO_VELOCITY, now), "joints": ()}


def _walking(velocity: Velocity, now: float) -> dict[str, object]:
    """Return the changes of the order for a velocity; ``now`` is monotonic time in s."""
    move, gait = velocity.linear, "walk" if velocity.gait == "walk" else "trot"
    return {"x": move.x, "y": move.y, "turn": velocity.yaw_rate, "gait": gait, "until": now + _FOREVER}
