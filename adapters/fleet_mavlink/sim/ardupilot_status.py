"""Health of ArduPilot as it reports it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.system_status import GPS_BIT, PREARM_BIT, RC_BIT, SystemStatus

if TYPE_CHECKING:
    from fleet_mavlink.sim.ardupilot import ArduPilot


class ArduPilotStatus(SystemStatus):
    """Health of one ArduPilot."""

    def __init__(self, pilot: ArduPilot) -> None:
        self._pilot = pilot

    def sensors(self) -> tuple[int, int, int]:
        """Return the observed bits, with the present GPS and PREARM_CHECK."""
        pilot = self._pilot
        healthy = 0x4770FC0F | (GPS_BIT if pilot.gps.fix else 0)
        healthy |= 0 if pilot.failsafes.radio_lost else RC_BIT
        if pilot.arming.passed:
            healthy |= PREARM_BIT
        return 0x5371FC2F, 0x5361FC2F if pilot.armed else 0x5261FC2F, healthy

    def state(self) -> int:
        """Return MAV_STATE; STANDBY and ACTIVE depend on being landed, not on being armed."""
        pilot = self._pilot
        if not pilot.initialised:
            return int(mav.MAV_STATE_BOOT)
        if pilot.failsafe or pilot.failsafes.radio_lost:
            return int(mav.MAV_STATE_CRITICAL)
        return int(mav.MAV_STATE_ACTIVE if pilot.armed and pilot.flying else mav.MAV_STATE_STANDBY)
