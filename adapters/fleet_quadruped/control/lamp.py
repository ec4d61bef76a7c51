"""The lamp of a dog: two frames, sent when the wish changes."""

from __future__ import annotations

from collections.abc import Mapping

from fleet import CanBus, CanFrame
from fleet_quadruped.robot.parts import Switch


class Lamp:
    """A lamp that may not be there."""

    def __init__(self, led: Switch | None, buses: Mapping[str, CanBus]) -> None:
        self._led = led
        self._buses = buses
        self._shown: bool | None = None

    def show(self, lamp: bool | None) -> None:  # noqa: FBT001 - three values, as it crosses the process
        """Turn the lamp on or off when that is new; None leaves it alone."""
        led = self._led
        if led is None or lamp is None or lamp == self._shown:
            return
        self._shown = lamp
        self._buses[led.bus].send(CanFrame(led.id, bytes.fromhex(led.on if lamp else led.off)))
