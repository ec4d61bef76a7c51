"""What crosses between the adapter and the body controller: the newest order in, the newest state out."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest


class Activity(msgspec.Struct, frozen=True):
    """Something discrete that is asked; each has its own number, so that it is done once."""

    number: int = 0
    ask: BodyRequest = BodyRequest.STAND
    value: float = 0.0


class Order(msgspec.Struct, frozen=True):
    """The newest wish of the adapter. ``until`` is the monotonic time at which the velocity ends.

    ``joints``: where each is led, rad, in the order of ``JOINTS``, None or left out where it is not; until
    ``joints_until``. ``stop`` counts emergency stops, ``halts`` all stops: a higher number than before is
    one. ``lamp``: None leaves it alone. ``frames``: somebody records what is on the buses.
    """

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0
    gait: Literal["trot", "walk"] = "trot"
    until: float = 0.0
    alive: float = 0.0  # monotonic time at which the adapter wrote this
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
        """The velocity."""
        return Twist(self.x, self.y, self.turn)


class Timing(msgspec.Struct, frozen=True):
    """Real-time quality since the start; times in seconds."""

    realtime: bool = False  # the scheduler gave us a real-time priority
    rate: float = 0.0  # cycles a second, over the last second
    cycles: int = 0
    overruns: int = 0  # cycles that began late by more than half a cycle
    incomplete: int = 0  # cycles in which a drive did not answer in time
    worst: float = 0.0  # longest cycle (read, body, write) of the last second
    age: float = 0.0  # oldest feedback of any joint
    clamped: int = 0  # targets that the limits changed
    dropped: int = 0  # frames that could not be sent


class DogState(msgspec.Struct, frozen=True):
    """The newest state of the dog. Angles in the order of ``JOINTS``; ``stamp`` is monotonic.

    ``measured``, ``posed`` and ``felt`` are the monotonic times at which each joint, the oldest of what the
    pose is made of, and the IMU were measured; -inf before the first time.
    """

    stamp: float = 0.0
    mode: str = "off"
    fault: str = ""
    warning: str = ""
    answered: int = 0  # number of the last errand
    refusal: str = ""  # why it was refused, empty when it was taken
    stopped: int = 0  # number of the last emergency stop that was obeyed
    measured: tuple[float, ...] = ()
    posed: float = -math.inf
    felt: float = -math.inf
    posture: tuple[float, ...] = ()  # near which its joints are led, rad; empty when they are not
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
    timing: Timing = Timing()
    capture: str = ""  # the file with what was on the buses before the fault
