"""Profiles of the known bases, as data. A further base needs one more entry and, if necessary, a codec.

Wheel and track of Waveshare's boards are those of their firmware. The effective track of a tracked base is
wider than the geometric one: calibrate it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import msgspec

from fleet import Limits
from fleet_ugv.battery import TEN_LITHIUM, THREE_LITHIUM, Curve
from fleet_ugv.codecs.arduino import COUNTER, ArduinoCodec, Servo
from fleet_ugv.codecs.base import Codec
from fleet_ugv.codecs.hoverboard import HoverboardCodec
from fleet_ugv.codecs.waveshare import WaveshareCodec


class CodecSettings(msgspec.Struct, frozen=True):
    """Parameters of a codec: those of the profile, overridden by the robot's own."""

    timeout: float
    module: int
    ticks: float
    diameter: float
    servo: Servo | None


class BaseProfile(msgspec.Struct, frozen=True):
    """One kind of base.

    ``baud``; ``track`` and ``diameter`` (of the wheels) in m; ``fastest``: top speed of a side, m/s;
    ``timeout``: of the firmware's dead-man, s, None when it has none; ``settable``: it is set by us, and the
    board confirms it. ``poll``: s between requests, 0 for a base that streams. ``keep``: s between two frames
    that hold a velocity; ``idle``: zeros are also sent at rest. ``ticks`` per metre, and the number of ticks
    at which the counters wrap around.
    """

    codec: Callable[[CodecSettings], Codec]
    baud: int
    track: float
    diameter: float
    fastest: float
    limits: Limits
    timeout: float | None
    settable: bool = False
    poll: float = 0.0
    keep: float = 0.1
    idle: bool = False
    ticks: float = 0.0
    counter: int | None = None
    curve: Curve | None = None


def _waveshare(main: int, *, track: float, diameter: float, speed: float) -> BaseProfile:
    """Return the profile of one of Waveshare's bases; ``main`` is its number in T 900."""
    return BaseProfile(
        codec=lambda setting: WaveshareCodec(main=main, module=setting.module, timeout=setting.timeout),
        baud=115200,
        track=track,
        diameter=diameter,
        fastest=speed * 1.5,
        limits=Limits(speed=speed, yaw_rate=2.0),
        timeout=0.5,
        settable=True,
        curve=THREE_LITHIUM,
    )


PROFILES: Mapping[str, BaseProfile] = MappingProxyType(
    {
        "waveshare-rasprover": _waveshare(1, track=0.125, diameter=0.080, speed=0.65),
        "waveshare-rover": _waveshare(2, track=0.172, diameter=0.080, speed=1.0),
        "waveshare-beast": _waveshare(3, track=0.141, diameter=0.0523, speed=0.35),
        "ros-arduino": BaseProfile(
            codec=lambda setting: ArduinoCodec(ticks=setting.ticks, servo=setting.servo),
            baud=57600,
            track=0.30,
            diameter=0.12,
            fastest=0.9,
            limits=Limits(speed=0.6, yaw_rate=2.0),
            timeout=2.0,
            poll=0.05,
            ticks=4000.0,
            counter=COUNTER,
        ),
        "hoverboard": BaseProfile(
            codec=lambda setting: HoverboardCodec(diameter=setting.diameter),
            baud=115200,
            track=0.50,
            diameter=0.165,
            fastest=1.5,
            limits=Limits(speed=1.0, yaw_rate=1.5),
            timeout=0.8,
            keep=0.05,
            idle=True,
            curve=TEN_LITHIUM,
        ),
    }
)
