"""Event metadata of a vehicle: from the local cache, by checksum, else downloaded while on the ground."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
from pathlib import Path

from fleet import CommandError
from fleet_mavlink.constants import PX4
from fleet_mavlink.events import PATH, EventDictionary
from fleet_mavlink.files import FtpClient
from fleet_mavlink.vehicle import Vehicle

_FOREVER = 3600.0  # s between checks when nothing happens
_AGAIN = 30.0  # s
_TRIES = 3


def cache() -> Path:
    """Return the cache folder for lists of events."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "fleet" / "mavlink-events"


class EventKeeper:
    """Loads the event dictionary of a vehicle, again after each of its restarts."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._files = FtpClient(vehicle)

    async def run(self) -> None:
        """Load the metadata whenever the vehicle is connected and on the ground, until cancelled."""
        while True:
            while not await self._vehicle.until(lambda _: self._vehicle.connected, _FOREVER):
                self._vehicle.log.debug("it is still not met")
            reboots = self._vehicle.state.reboots
            beat = self._vehicle.state.heartbeat
            if beat is not None and beat.autopilot == PX4:
                await self._get()
            await self._vehicle.restarted(reboots, _FOREVER)

    async def _get(self) -> None:
        """Get the metadata; a vehicle without it is used without."""
        for attempt in range(_TRIES):
            while not await self._vehicle.until(lambda state: not state.armed, _FOREVER):
                self._vehicle.log.debug("it is still armed")
            try:
                self._vehicle.dictionary = EventDictionary(await self._packed(refetch=attempt > 0))
            except (CommandError, ValueError) as error:
                self._vehicle.log.info("its events are not explained: %s", error)
                await asyncio.sleep(_AGAIN)
            else:
                return

    async def _packed(self, *, refetch: bool) -> bytes:
        """Return the file: from the cache by its checksum, or from the vehicle (always if ``refetch``)."""
        checksum = await self._files.checksum(PATH)
        kept = cache() / f"{checksum:08x}.json.xz"
        with contextlib.suppress(OSError):
            data = b"" if refetch else await asyncio.to_thread(kept.read_bytes)
            if data:
                return data
        data = await self._files.read(PATH)
        with contextlib.suppress(OSError):
            await asyncio.to_thread(_keep, kept, data)
        return data


def _keep(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "wb") as file:
        file.write(data)
    Path(name).replace(path)
