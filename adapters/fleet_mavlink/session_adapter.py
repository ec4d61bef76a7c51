"""What the parts of the MAVLink adapter share: the session, while there is one."""

from __future__ import annotations

from fleet import Adapter, NotReady
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.session import VehicleSession


class SessionAdapter(Adapter[MavlinkConfig]):
    """An adapter that has a session with its vehicle while the link is open."""

    def __init__(self, config: MavlinkConfig) -> None:
        super().__init__(config)
        self._session: VehicleSession | None = None

    def _open(self) -> VehicleSession:
        """Return the session; raises NotReady without one."""
        if self._session is None:
            raise NotReady("the link is not open yet")
        return self._session
