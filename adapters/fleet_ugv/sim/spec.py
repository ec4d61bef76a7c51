"""Specification of a simulated base, and its construction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

from fleet.sim.faults import parse_faults
from fleet_ugv.profiles import PROFILES
from fleet_ugv.sim.arduino import ArduinoBoard
from fleet_ugv.sim.board import SimBoard
from fleet_ugv.sim.faults import FAULTS
from fleet_ugv.sim.hoverboard import HoverboardBoard
from fleet_ugv.sim.physics import BaseBody
from fleet_ugv.sim.waveshare import WaveshareBoard

SKID = 1.3  # assumed ratio of effective to geometric track, for a base that slips in turns


class BaseSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One simulated base: profile, initial faults, ticks per metre and wheel diameter (m; 0: the profile's).

    ``firmware``: of Waveshare's boards, ugv_base_ros or ugv_base_general.
    """

    profile: str
    seed: int = 1
    faults: dict[str, float] = {}
    ticks: float = 0.0
    diameter: float = 0.0
    firmware: Literal["ros", "general"] = "ros"


def spec_of(link: str, *, ticks: float, diameter: float) -> BaseSpec:
    """Parse ``sim:PROFILE?fault=NAME:VALUE,...&seed=N&firmware=general``; raises ValueError."""
    profile, _, query = link.removeprefix("sim:").partition("?")
    fields = dict(part.partition("=")[::2] for part in query.split("&") if part)
    if unknown := fields.keys() - {"fault", "seed", "firmware"}:
        raise ValueError(f"{link!r}: {min(unknown)!r} is not known; there are fault, seed and firmware")
    seed = fields.get("seed", "1")
    if not seed.isdigit():
        raise ValueError(f"{link!r}: the seed {seed!r} is no whole number")
    firmware = fields.get("firmware", "ros")
    if firmware not in {"ros", "general"}:
        raise ValueError(f"{link!r}: the firmware {firmware!r} is not known; there are ros and general")
    faults = parse_faults(fields.get("fault", ""), FAULTS)
    return BaseSpec(
        profile, int(seed), faults, ticks, diameter, "general" if firmware == "general" else "ros"
    )


def _waveshare(spec: BaseSpec) -> SimBoard:
    """Return one of Waveshare's boards."""
    profile = PROFILES[spec.profile]
    tracked = SKID if spec.profile != "waveshare-rasprover" else 1.15
    body = BaseBody(profile.track, tracked, fastest=profile.fastest)
    return WaveshareBoard(body, general=spec.firmware == "general", seed=spec.seed)


def _arduino(spec: BaseSpec) -> SimBoard:
    """Return a two-wheeled base with encoders."""
    profile = PROFILES[spec.profile]
    body = BaseBody(profile.track, fastest=profile.fastest)
    return ArduinoBoard(body, ticks=spec.ticks or profile.ticks, seed=spec.seed)


def _hoverboard(spec: BaseSpec) -> SimBoard:
    """Return a hoverboard."""
    profile = PROFILES[spec.profile]
    body = BaseBody(profile.track, fastest=profile.fastest * 2)
    return HoverboardBoard(body, diameter=spec.diameter or profile.diameter, seed=spec.seed)


BOARDS: Mapping[str, Callable[[BaseSpec], SimBoard]] = MappingProxyType(
    {
        "waveshare-beast": _waveshare,
        "waveshare-rover": _waveshare,
        "waveshare-rasprover": _waveshare,
        "ros-arduino": _arduino,
        "hoverboard": _hoverboard,
    }
)


def board_of(spec: BaseSpec) -> SimBoard:
    """Return the specified base; raises ValueError for an unknown one."""
    if spec.profile not in BOARDS:
        raise ValueError(f"there is no simulated {spec.profile!r}; there are {', '.join(BOARDS)}")
    board = BOARDS[spec.profile](spec)
    for name, value in spec.faults.items():
        board.set_fault(name, value)
    return board
