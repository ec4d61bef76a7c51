"""Messages between adapter and body controller: the newest order in, the newest state out."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest


class Activity(msgspec.Struct, frozen=True):
    """A discrete request; its number makes it execute exactly once."""

    number: int = 0
    request: BodyRequest = BodyRequest.STAND
    value: float = 0.0


class Order(msgspec.Struct, frozen=True):
    """Newest request of the adapter. ``until``: monotonic time (s) at which the velocity ends.

    ``joints``: targets, rad, in the order of ``JOINTS``, valid until ``joints_until``; None, or left out, for
    joints without one. ``stop`` counts emergency stops, ``halts`` all stops: a higher number than before is a
    new one. ``lamp``: None leaves it unchanged. ``frames``: a recorder wants the frames of the buses.
    """

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0
    gait: Literal["trot", "walk"] = "trot"
    until: float = 0.0
    alive: float = 0.0  # monotonic time of writing
    activity: Activity = Activity()
    joints: tuple[float | None, ...] = ()
    joints_until: float = 0.0
    stop: int = 0
    halts: int = 0
    lamp: bool | None = None
    leave: bool = False
    frames: bool = False

    @property
    def twist(self) -> Twist:
        """Requested velocity."""
        return Twist(self.x, self.y, self.turn)


class LoopTiming(msgspec.Struct, frozen=True):
    """Timing statistics since the start; times in seconds."""

    realtime: bool = False  # the scheduler granted a real-time priority
    rate: float = 0.0  # cycles a second, over the last second
    cycles: int = 0
    overruns: int = 0  # cycles that began late by more than half a cycle
    incomplete: int = 0  # cycles in which a drive did not answer in time
    worst: float = 0.0  # longest cycle (read, body, write) of the last second
    age: float = 0.0  # age of the oldest joint feedback
    clamped: int = 0  # targets changed by the limits
    dropped: int = 0  # frames that could not be sent


class DogState(msgspec.Struct, frozen=True):
    """Newest state of the robot. Angles in the order of ``JOINTS``; ``stamp`` is monotonic.

    ``measured``, ``posed`` and ``felt`` are the monotonic times of measurement of each joint, of the oldest
    part of the pose, and of the IMU; -inf before the first measurement.
    """

    stamp: float = 0.0
    mode: str = "off"
    fault: str = ""
    warning: str = ""
    answered: int = 0  # number of the last activity
    refusal: str = ""  # reason of its refusal, empty if it was accepted
    stopped: int = 0  # number of the last executed emergency stop
    halted: int = 0  # number of the last executed stop of any kind
    measured: tuple[float, ...] = ()
    posed: float = -math.inf
    felt: float = -math.inf
    posture: tuple[float, ...] = ()  # rad: reference of joint moves; empty outside joint mode
    angles: tuple[float, ...] = ()
    speeds: tuple[float, ...] = ()
    torques: tuple[float, ...] = ()
    temperatures: tuple[float | None, ...] = ()
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    twist: tuple[float, ...] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    gyro: tuple[float, float, float] | None = None
    accel: tuple[float, float, float] | None = None
    battery: dict[str, float] = {}
    battery_age: float | None = None
    loads: dict[str, float] = {}
    timing: LoopTiming = LoopTiming()
    capture: str = ""  # path of the capture file of the fault
