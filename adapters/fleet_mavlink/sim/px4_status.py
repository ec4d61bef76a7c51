"""Health of PX4 as it reports it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.system_status import GPS_BIT, PREARM_BIT, RC_BIT, SystemStatus

if TYPE_CHECKING:
    from fleet_mavlink.sim.px4 import SimPx4


class Px4Status(SystemStatus):
    """Health of one PX4."""

    def __init__(self, pilot: SimPx4) -> None:
        self._pilot = pilot

    def sensors(self) -> tuple[int, int, int]:
        """Return the observed bits, with those of GPS and PREARM_CHECK as they are now."""
        pilot = self._pilot
        if not pilot.uptime.reached(3.0):
            return 0, 0, 0x321C83F & ~GPS_BIT
        healthy = 0x320C81F | (GPS_BIT if pilot.gps.fix else 0)
        if not pilot.arming.refusals(force=False):
            healthy |= PREARM_BIT
        receiver = RC_BIT if pilot.has_receiver else 0
        healthy |= RC_BIT if pilot.remote_control else 0
        return 0x300402F | receiver, 0x301402F, healthy

    def state(self) -> int:
        """Return MAV_STATE; STANDBY or ACTIVE depends on the motors being armed."""
        pilot = self._pilot
        if pilot.terminated:
            return int(mav.MAV_STATE_FLIGHT_TERMINATION)
        if not pilot.initialised:
            return int(mav.MAV_STATE_UNINIT)
        if pilot.failsafe:
            return int(mav.MAV_STATE_CRITICAL)
        return int(mav.MAV_STATE_ACTIVE if pilot.armed else mav.MAV_STATE_STANDBY)
