"""Health of a simulated autopilot as it reports it: what each autopilot brings."""

from __future__ import annotations

from abc import ABC, abstractmethod

PREARM_BIT, GPS_BIT, RC_BIT = 0x10000000, 0x20, 0x10000  # MAV_SYS_STATUS_SENSOR


class SystemStatus(ABC):
    """Health of one autopilot."""

    @abstractmethod
    def sensors(self) -> tuple[int, int, int]:
        """Return the sensors of SYS_STATUS: present, enabled, healthy."""

    @abstractmethod
    def state(self) -> int:
        """Return MAV_STATE, as in HEARTBEAT."""
