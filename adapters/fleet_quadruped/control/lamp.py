"""Lamp of a robot: two frames, sent when the requested state changes."""

from __future__ import annotations

from collections.abc import Mapping

from fleet import CanBus, CanFrame
from fleet_quadruped.robot.parts import Switch


class Lamp:
    """A lamp; without one in the description it does nothing."""

    def __init__(self, led: Switch | None, buses: Mapping[str, CanBus]) -> None:
        self._led = led
        self._buses = buses
        self._shown: bool | None = None

    def show(self, lamp: bool | None) -> None:  # noqa: FBT001 - three values, as in Order
        """Turn the lamp on or off if the request is new; None leaves it unchanged."""
        led = self._led
        if led is None or lamp is None or lamp == self._shown:
            return
        self._shown = lamp
        self._buses[led.bus].send(CanFrame(led.id, bytes.fromhex(led.on if lamp else led.off)))
