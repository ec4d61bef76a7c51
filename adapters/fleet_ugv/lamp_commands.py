"""Commands for the lamps. None of them moves the base."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeVar

from fleet import Range, Refused, command
from fleet_ugv.accessories import Lamps
from fleet_ugv.board_adapter import BoardAdapter

GivenT = TypeVar("GivenT")

_Level = Annotated[int, Range(0, 255, "(full brightness)")]
_Levels = Annotated[list[int], Range(0, 255, "(full brightness)")]


class LampCommands(BoardAdapter):
    """Chassis and camera lamp, each by its level, 0 (off) to 255."""

    _lamps: Lamps

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
