"""Shared base of the MAVLink adapter's parts: the session with the vehicle."""

from __future__ import annotations

from fleet import Adapter
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.session import VehicleSession


class SessionAdapter(Adapter[MavlinkConfig]):
    """An adapter whose ``connect`` starts a session with its vehicle."""

    _session: VehicleSession
