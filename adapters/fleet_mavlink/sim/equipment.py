"""What a simulated vehicle carries besides its autopilot; it survives a reboot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.compass import SimCompass
from fleet_mavlink.sim.gimbal import SimGimbal
from fleet_mavlink.sim.logs import SimLogs

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot


class Equipment:
    """Logs, a compass, and a gimbal where there is one."""

    def __init__(self, *, ardupilot: bool) -> None:
        self.logs = SimLogs(1 if ardupilot else 0)
        self.compass = SimCompass(words=not ardupilot)
        self.gimbal: SimGimbal | None = None

    def reboot(self) -> None:
        """End what was under way."""
        self.logs.reboot()
        self.compass = SimCompass(words=self.compass.words)

    def tick(self, pilot: Autopilot, dt: float) -> list[object]:
        """Move on; return what is told of its own accord."""
        told = self.logs.pending()
        told += self.compass.tick(pilot.time, pilot, fails="compass_fails" in pilot.faults)
        if self.gimbal is not None:
            self.gimbal.tick(dt)
        return told
