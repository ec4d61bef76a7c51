"""Equipment of a simulated vehicle besides its autopilot; it survives a reboot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.compass import SimCompass
from fleet_mavlink.sim.files import FILES, SimFiles
from fleet_mavlink.sim.gimbal import SimGimbal
from fleet_mavlink.sim.logs import SimLogs
from fleet_mavlink.sim.remote_id import SimRemoteId

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot


class Equipment:
    """Logs, files, a compass, and optionally gimbal and Remote ID."""

    def __init__(self, *, ardupilot: bool) -> None:
        self.logs = SimLogs(1 if ardupilot else 0)
        self.files = SimFiles({} if ardupilot else FILES)
        self.compass = SimCompass(words=not ardupilot)
        self.gimbal: SimGimbal | None = None
        self.remote_id: SimRemoteId | None = None

    def reboot(self) -> None:
        """End activities in progress."""
        self.logs.reboot()
        self.files.reboot()
        self.compass = SimCompass(words=self.compass.words)
        self.remote_id = SimRemoteId() if self.remote_id is not None else None

    def tick(self, pilot: Autopilot, dt: float) -> list[object]:
        """Advance; return unsolicited messages."""
        messages = self.logs.pending()
        messages += self.compass.tick(pilot.time, pilot, fails="compass_fails" in pilot.faults)
        if self.gimbal is not None:
            self.gimbal.tick(dt)
        if self.remote_id is not None:
            self.remote_id.say(pilot)
        return messages
