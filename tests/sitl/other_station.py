"""Another ground station on the adapter's own link: what it asks is not the adapter's doing."""

from __future__ import annotations

import asyncio
import contextlib
import math

from pymavlink.dialects.v20 import all as mav

STATION = (255, 190)
NAN = math.nan
GUIDED_ROVER = 15


class OtherStation:
    """Speaks to the vehicle of ``it`` as station 255/190."""

    def __init__(self, it):
        self._it = it
        self._packer = mav.MAVLink(None, srcSystem=STATION[0], srcComponent=STATION[1])
        self._streaming = None

    def send(self, message):
        """Write a message to the vehicle."""
        session = self._it.adapter._session
        session._hub.link.send(bytes(message.pack(self._packer)), session.vehicle.address)

    @property
    def system(self):
        """The vehicle's system id."""
        return self._it.adapter._session.vehicle.system

    def request(self, command, *params):
        """Send a COMMAND_LONG."""
        values = [*params, *([0.0] * (7 - len(params)))]
        self.send(mav.MAVLink_command_long_message(self.system, 1, command, 0, *values))

    def go(self, north, east, height):
        """Send it to a place, m from where it is and above home, as PX4 takes it."""
        state = self._it.state
        here, home = state.position, state.home_altitude
        latitude = int((here.latitude + north / 111_195) * 1e7)
        longitude = int((here.longitude + east / (111_195 * math.cos(math.radians(here.latitude)))) * 1e7)
        self.send(
            mav.MAVLink_command_int_message(
                self.system, 1, 0, 192, 0, 0, -1, 1, 0, NAN, latitude, longitude, home + height
            )
        )

    @contextlib.asynccontextmanager
    async def driving(self, speed):
        """Keep a rover at a speed, m/s, straight ahead."""

        async def stream():
            while True:
                zeros = (0.0, 0.0, 0.0)
                self.send(
                    mav.MAVLink_set_position_target_local_ned_message(
                        0, self.system, 1, 8, 0x0DC7, *zeros, speed, 0.0, 0.0, *zeros, 0.0, 0.0
                    )
                )
                await asyncio.sleep(0.2)

        task = asyncio.ensure_future(stream())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
