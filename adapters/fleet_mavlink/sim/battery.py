"""Battery: drains faster in the air, and its voltage follows the charge."""

from __future__ import annotations

from collections.abc import Callable

_IDLE, _FLYING = 0.5, 12.0  # amperes


class SimBattery:
    """A pack of ``capacity_mah``; volts fall from ``full`` to ``empty`` as it drains.

    ``whole`` rounds to the whole percents of the messages: PX4 rounds up (``ceilf``), ArduPilot down.
    """

    def __init__(
        self, full: float, empty: float, whole: Callable[[float], int], capacity_mah: float = 5000.0
    ) -> None:
        self._full = full
        self._empty = empty
        self._whole = whole
        self._capacity = capacity_mah
        self.percent = 100.0
        self.amperes = _IDLE

    @property
    def volts(self) -> float:
        """Voltage of the whole pack."""
        return self._empty + (self._full - self._empty) * self.percent / 100.0

    def at_most(self, *, volts: float) -> None:
        """Discharge it to a voltage."""
        if self.volts > volts:
            self.percent = max(0.0, 100.0 * (volts - self._empty) / (self._full - self._empty))

    @property
    def whole_percent(self) -> int:
        """Remaining percent, as in SYS_STATUS and BATTERY_STATUS."""
        return self._whole(self.percent)

    @property
    def used_mah(self) -> float:
        """Charge used since it was full."""
        return self._capacity * (100.0 - self.percent) / 100.0

    @property
    def seconds_left(self) -> float:
        """Seconds until it is empty, at the present current."""
        return (self._capacity - self.used_mah) * 3.6 / self.amperes

    def drain(self, flying: bool, dt: float) -> None:  # noqa: FBT001 - a physical input
        """Discharge it by the consumption of ``dt`` seconds."""
        self.amperes = _FLYING if flying else _IDLE
        used = self.amperes * 1000.0 * dt / 3600.0
        self.percent = max(0.0, self.percent - 100.0 * used / self._capacity)
