"""Specification of a simulated vehicle, and its form as a ``sim:`` link."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal
from urllib.parse import parse_qsl

import msgspec

from fleet import convert_strictly
from fleet.sim.faults import parse_faults
from fleet_mavlink.sim.faults import FAULTS

QUICK_READY = 3.0  # s until a vehicle of a ``sim:`` link can be armed, by default
VehicleName = Literal["multirotor", "rover", "plane", "vtol"]
VEHICLES: Mapping[str, tuple[VehicleName, ...]] = {
    "ardupilot": ("multirotor", "rover", "plane", "vtol"),
    "px4": ("multirotor", "plane", "vtol"),
}
Home = tuple[float, float, float, float]
ZURICH: Home = (47.397742, 8.545594, 488.0, 0.0)
_KEYS = ("vehicle", "home", "ready", "speed", "fault", "seed", "with")


class VehicleSpec(msgspec.Struct, frozen=True):
    """One simulated vehicle.

    ``vehicle``: its type; ``VEHICLES`` has the types of each flavour.
    ``home``: latitude, longitude (degrees), altitude (m above sea level), heading (degrees).
    ``ready``: seconds of simulation until it can be armed; None: like the real one (42.6 s, 4.6 s).
    ``speed``: seconds of simulation per second. ``faults``: active from the start.
    ``accessories``: further components on its link, ``gimbal``, ``adsb``, ``camera`` and, for ArduPilot,
    ``remote_id``.
    """

    flavour: Literal["ardupilot", "px4"]
    vehicle: VehicleName = "multirotor"
    system_id: int = 1
    home: Home = ZURICH
    ready: float | None = QUICK_READY
    speed: float = 1.0
    faults: dict[str, float] = {}
    seed: int = 1
    accessories: tuple[Literal["gimbal", "adsb", "camera", "remote_id"], ...] = ()

    def __post_init__(self) -> None:
        """Raise ValueError for impossible values."""
        if self.vehicle not in VEHICLES[self.flavour]:
            raise ValueError(f"there is no simulated {self.vehicle} on {self.flavour}")
        if "remote_id" in self.accessories and self.flavour != "ardupilot":
            raise ValueError("only ArduPilot is simulated with remote_id")
        if not 1 <= self.system_id <= 254:
            raise ValueError(f"system id {self.system_id} is not 1 to 254")
        if not 0.01 <= self.speed <= 100.0:
            raise ValueError(f"speed {self.speed:g} is not 0.01 to 100")
        if self.ready is not None and not 0.0 <= self.ready <= 3600.0:
            raise ValueError(f"ready {self.ready:g} is not 0 to 3600 seconds")
        latitude, longitude, altitude, heading = self.home
        sane = abs(latitude) <= 89.0 and abs(longitude) <= 180.0 and abs(altitude) < 10_000.0
        if not (sane and math.isfinite(heading)):
            raise ValueError(f"home {latitude:g},{longitude:g},{altitude:g},{heading:g} is not on Earth")

    @classmethod
    def parse(cls, link: str, *, system_id: int = 1) -> VehicleSpec:
        """Return the spec of ``sim:px4?home=47.39,8.54,488,0&ready=3&speed=1&fault=loss:0.01``.

        ``ready=real`` takes as long as the real autopilot. Raises ValueError with the reason.
        """
        scheme, _, rest = link.partition(":")
        flavour, _, query = rest.partition("?")
        if scheme != "sim" or flavour not in {"ardupilot", "px4"}:
            raise ValueError(f"{link!r} is no simulated vehicle; say sim:px4 or sim:ardupilot")
        try:
            pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
        except ValueError:
            raise ValueError(f"{link!r}: write options as name=value joined by &") from None
        given = dict(pairs)
        for key in given:
            if key not in _KEYS:
                raise ValueError(f"{link!r}: there is no option {key!r}; there are {', '.join(_KEYS)}")
        if len(given) != len(pairs):
            raise ValueError(f"{link!r}: an option is given twice")
        return _spec({"flavour": flavour, "system_id": system_id}, given)


def _spec(values: dict[str, object], given: dict[str, str]) -> VehicleSpec:
    """Return the spec from the text of its options."""
    if "vehicle" in given:
        values["vehicle"] = given["vehicle"]
    if "home" in given:
        values["home"] = parse_home(given["home"])
    if "ready" in given:
        values["ready"] = parse_ready(given["ready"])
    if "speed" in given:
        values["speed"] = _number("speed", given["speed"])
    if "seed" in given:
        values["seed"] = int(_number("seed", given["seed"]))
    if "fault" in given:
        values["faults"] = parse_faults(given["fault"], FAULTS)
    if "with" in given:
        values["accessories"] = tuple(given["with"].split(","))
    return spec_of(values)


def spec_of(values: object) -> VehicleSpec:
    """Return the spec from plain values (JSON); raises ValueError with the reason."""
    try:
        return convert_strictly(values, VehicleSpec)
    except msgspec.ValidationError as error:
        raise ValueError(f"simulated vehicle: {error}") from None


def parse_home(text: str) -> Home:
    """Return ``LAT,LON,ALT,HEADING``; the heading may be left out."""
    numbers = [_number("home", part) for part in text.split(",")]
    if len(numbers) == 3:
        numbers.append(0.0)
    if len(numbers) != 4:
        raise ValueError(f"home {text!r} is not LATITUDE,LONGITUDE,ALTITUDE,HEADING")
    return numbers[0], numbers[1], numbers[2], numbers[3]


def parse_ready(text: str) -> float | None:
    """Return seconds, None for ``real``."""
    return None if text == "real" else _number("ready", text)


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{name}: {text!r} is not a number")
    return number
