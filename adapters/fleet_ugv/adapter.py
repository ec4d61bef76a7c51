"""Adapter for wheeled bases on a serial line."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, TypeVar

from fleet import (
    Adapter,
    JointRange,
    LatestMotion,
    Limits,
    Link,
    LinkLost,
    NotReady,
    Range,
    Refused,
    Robot,
    Separation,
    TimedOut,
    Velocity,
    command,
    opened_link,
    parse_link_url,
    photograph,
)
from fleet.sim.process import SimProcess
from fleet_ugv.accessories import MOUNT, CameraMount, Lamps
from fleet_ugv.board import Board, Inbox
from fleet_ugv.config import UgvConfig
from fleet_ugv.observer import Observer
from fleet_ugv.odometry import POSE, WheelOdometry
from fleet_ugv.sim.rehearsed import simulated_base
from fleet_ugv.sim.spec import spec_of

GivenT = TypeVar("GivenT")

STANDSTILL = 3.0  # s, of the host's 5 s, that a stop waits until the wheels are seen to stand
NUDGE = 0.1  # rad by which camera_up, _down, _left and _right move
SIMULATOR = "fleet_ugv.sim"
_Level = Annotated[int, Range(0, 255, "(full brightness)")]
_Levels = Annotated[list[int], Range(0, 255, "(full brightness)")]
_Pan = Annotated[float, Range(-math.pi, math.pi, "rad")]
_Tilt = Annotated[float, Range(-math.pi / 6, math.pi / 2, "rad")]
_Delta = Annotated[float, Range(-math.tau, math.tau, "rad")]


def _replayed(config: Any, robot: Robot) -> UgvAdapter:
    """Return the adapter itself for a replay: it reaches nothing but its link."""
    return UgvAdapter(config, robot)


class UgvAdapter(Adapter[UgvConfig]):
    """Drives a wheeled base, reports its odometry and battery, and stops it whatever fails."""

    Config = UgvConfig
    limits: ClassVar[Limits] = Limits(speed=1.0, yaw_rate=2.0)
    separation: ClassVar[Separation] = Separation(radius=0.4, braking=1.0, precedence=2)
    combines_keys: ClassVar[bool] = True
    simulation = staticmethod(simulated_base)
    replayed = staticmethod(_replayed)

    def __init__(self, config: UgvConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        if config.base.timeout is not None:
            self.failsafe = f"its firmware stops {config.setting.timeout:g} s after the last velocity"
        self._lamps = Lamps()
        self._mount = CameraMount()
        # Where the robot is outlives its cable.
        self._odometry = WheelOdometry(config.scale, config.base.fastest, robot.state.get(POSE))
        self._board: Board
        self._link: Link

    async def connect(self) -> None:
        """Open the line; raises LinkLost or LinkRefused."""
        url = await _url(self.config, self.robot)
        inbox = Inbox(self.config, self.robot.clock)
        self._link = await self.robot.enter(opened_link(url, inbox.arrived))
        slot = LatestMotion(self._link, self.robot.clock, baud=parse_link_url(url).baud)
        self._board = Board(self.config, self.robot, Observer(self.config, self._odometry), inbox, slot)
        self._board.begin(self._link)

    async def run(self) -> None:
        """Serve the base until its line falls; raises LinkLost."""
        try:
            await self._link.lost()
        finally:
            self._board.end()
            self.robot.state[POSE] = self._odometry.pose

    def drive(self, velocity: Velocity) -> None:
        """Hold this body velocity; a sideways part is dropped."""
        self._board.drive(velocity)

    async def stop(self, reason: str) -> None:  # noqa: ARG002 - whatever the reason, it stands
        """Stop the wheels and wait until they are seen to stand; raises TimedOut if they are not in time."""
        self.halt()
        if not self._board.serves:
            return
        self._board.stands.clear()  # what was seen before this stop says nothing about a velocity just before
        try:
            async with asyncio.timeout(STANDSTILL):
                await self._board.stands.wait()
        except TimeoutError:
            raise TimedOut(
                f"the wheels were not seen to stand within {STANDSTILL:g} s; "
                f"their last reported speed: {self._board.observer.speed:.2f} m/s",
                hint="stop it by other means",
            ) from None

    def halt(self) -> None:
        """Stop the wheels and the camera mount at once; from any thread."""
        self._board.halt()

    def halt_unheard(self, reason: str) -> bool:  # noqa: ARG002 - every stop is the same
        """Write the stops; raises LinkLost if the line does not take them."""
        if not self._board.halt():
            raise LinkLost(f"{self.config.link} is down")
        return True

    # -- the camera's joints -------------------------------------------------------------------------

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return pan (right positive) and tilt (up positive) of a base with a camera mount."""
        return MOUNT if self._board.codec.gimbal_stop else {}

    def move_joints(self, targets: Mapping[str, float]) -> None:
        """Turn the mount; a joint that is not named keeps its target. Angles are sent in whole degrees."""
        self._mount.lead(self._board, targets)

    def hold_joints(self) -> None:
        """Stop the mount where it is; from any thread."""
        self._board.hold_gimbal()

    # -- lamps, camera, display ----------------------------------------------------------------------

    @command("lights", moves=False, safe=True, timeout=2.0)
    async def lights(
        self,
        *,
        pwm: _Level | None = None,
        all: _Level | None = None,  # noqa: A002 - the word of the wire
        io4: _Level | None = None,
        io5: _Level | None = None,
        chassis_light: _Level | None = None,
        camera_light: _Level | None = None,
        data: _Levels | None = None,
        leds: _Levels | None = None,
    ) -> None:
        """Set the lamps, 0 to 255: pwm or all for both, io4 or chassis_light, io5 or camera_light."""
        both = _first(pwm, all)
        pair = _pair(_first(data, leds) or ())
        chassis = _first(chassis_light, io4, pair[0], both)
        camera = _first(camera_light, io5, pair[1], both)
        if chassis is None and camera is None:
            raise Refused("lights says no brightness", hint="pwm=0 to 255, or chassis_light and camera_light")
        self._lamps.set(self._board, chassis=chassis, camera=camera)

    @command("chassis_light_toggle", moves=False, safe=True, timeout=2.0)
    async def chassis_light_toggle(self) -> None:
        """Switch the chassis lamp on or off."""
        self._lamps.set(self._board, chassis=_toggled(self._lamps.chassis))

    @command("camera_light_toggle", moves=False, safe=True, timeout=2.0)
    async def camera_light_toggle(self) -> None:
        """Switch the camera lamp on or off."""
        self._lamps.set(self._board, camera=_toggled(self._lamps.camera))

    @command("led_toggle", moves=False, safe=True, timeout=2.0)
    async def led_toggle(self) -> None:
        """Switch both lamps on, or off when one is on."""
        level = _toggled(max(self._lamps.chassis, self._lamps.camera))
        self._lamps.set(self._board, chassis=level, camera=level)

    @command("camera_up", moves=False, timeout=2.0)
    async def camera_up(self) -> None:
        """Tilt the camera up by 0.1 rad."""
        self._mount.turn_by(self._board, tilt=NUDGE)

    @command("camera_down", moves=False, timeout=2.0)
    async def camera_down(self) -> None:
        """Tilt the camera down by 0.1 rad."""
        self._mount.turn_by(self._board, tilt=-NUDGE)

    @command("camera_left", moves=False, timeout=2.0)
    async def camera_left(self) -> None:
        """Pan the camera left by 0.1 rad."""
        self._mount.turn_by(self._board, pan=-NUDGE)

    @command("camera_right", moves=False, timeout=2.0)
    async def camera_right(self) -> None:
        """Pan the camera right by 0.1 rad."""
        self._mount.turn_by(self._board, pan=NUDGE)

    @command("camera_default", moves=False, timeout=2.0)
    async def camera_default(self) -> None:
        """Turn the camera straight ahead."""
        self._mount.turn(self._board, 0.0, 0.0)

    @command("camera_servo", moves=False, timeout=2.0)
    async def camera_servo(
        self,
        *,
        pan: _Pan | None = None,
        tilt: _Tilt | None = None,
        pan_delta: _Delta = 0.0,
        tilt_delta: _Delta = 0.0,
    ) -> None:
        """Turn the camera to pan and tilt (rad, right and up positive), or by their deltas."""
        at = self._mount.aimed(self._board)
        self._mount.turn(
            self._board,
            (at[0] if pan is None else pan) + pan_delta,
            (at[1] if tilt is None else tilt) + tilt_delta,
        )

    @command("oled_ctrl", moves=False, safe=True, timeout=2.0)
    async def oled_ctrl(self, *, text: str = "") -> None:
        """Write up to four lines on the display; nothing: its own text again."""
        board = self._board
        board.write(board.codec.display(text.splitlines()))

    # -- queries -------------------------------------------------------------------------------------

    @command("battery_check", moves=False, safe=True, timeout=2.0)
    async def battery_check(self) -> None:
        """Report the battery now."""
        observer = self._board.observer
        if observer.voltage is None:
            raise NotReady("the base has not reported its voltage")
        self.robot.report(observer.battery(self.robot.clock.time()))

    @command("get_status", moves=False, safe=True, timeout=2.0)
    async def get_status(self) -> None:
        """Report battery and metrics now."""
        observer = self._board.observer
        if observer.voltage is not None:
            self.robot.report(observer.battery(self.robot.clock.time()))
        self._board.metrics()

    @command("take_photo", moves=False, safe=True, timeout=10.0)
    async def take_photo(self) -> None:
        """Publish a picture of the configured camera."""
        self.robot.report(await photograph(self.config.camera, self.robot.clock))


def _toggled(level: int) -> int:
    """Return full brightness for a lamp that is off, else off."""
    return 0 if level else 255


def _first(*values: GivenT | None) -> GivenT | None:
    """Return the first value that is not None."""
    return next((value for value in values if value is not None), None)


def _pair(values: Sequence[int]) -> tuple[int | None, int | None]:
    """Return the chassis and camera levels in a list of one or two; raises Refused for a longer list."""
    if len(values) > 2:
        raise Refused("there are two lamps", hint="a list of two levels at most")
    return (values[0] if values else None, values[-1] if values else None)


async def _url(config: UgvConfig, robot: Robot) -> str:
    """Return the link to open; a simulated base is started first."""
    if not config.simulated:
        return config.link
    simulator = await robot.enter(robot.share(SIMULATOR, lambda: SimProcess(SIMULATOR)))
    setting = config.setting
    spec = spec_of(config.link, ticks=setting.ticks, diameter=setting.diameter)
    return await robot.enter(simulator.robot(spec))
