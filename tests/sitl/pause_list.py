"""What a vehicle is put through that a ground station beside the edge pauses, by a word it may not know.

A step is a coroutine that takes ``it`` (the adapter on a link) and ``station``, which operates it.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket

from pymavlink.dialects.v20 import all as mav

from fleet import GeoOrigin, Goal, GoTo, Vector3
from fleet.model.geodesy import world_from_geo
from fleet_mavlink.wings import Winged

LONG = 300.0  # s
HEIGHT = 40.0  # m
FAR = 1500.0  # m
DO_PAUSE_CONTINUE, DO_REPOSITION = 193, 192
NAN = math.nan


class Station:
    """A ground station at a UDP port, which operates what it is shown."""

    def __init__(self):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.watcher = {"link": f"udpout:127.0.0.1:{self._socket.getsockname()[1]}", "may": "operate"}
        self._packer = mav.MAVLink(None, srcSystem=255, srcComponent=190)

    def close(self):
        self._socket.close()

    def say(self, message):
        """Send a message to the edge, which has shown something before."""
        edge = None
        with contextlib.suppress(BlockingIOError):
            while True:
                _, edge = self._socket.recvfrom(4096)
        assert edge, "nothing was shown"
        self._socket.sendto(message.pack(self._packer), edge)

    def pause(self, it):
        """Send DO_PAUSE_CONTINUE."""
        zeros = (0.0,) * 6
        system = vehicle(it).system
        self.say(mav.MAVLink_command_long_message(system, 1, DO_PAUSE_CONTINUE, 0, 0.0, *zeros))

    def send_far(self, it):
        """Send it to a place far in the north."""
        here, system = it.state.position, vehicle(it).system
        place = (int((here.latitude + FAR / 111_195) * 1e7), int(here.longitude * 1e7), here.altitude)
        self.say(mav.MAVLink_command_int_message(system, 1, 0, DO_REPOSITION, 0, 0, -1, 1, 0, NAN, *place))


def vehicle(it):
    return it.adapter._session.vehicle


def mode(it):
    return vehicle(it).kind.mode_of(it.state)


def speed(it):
    return it.state.velocity.horizontal() if it.state.velocity else 0.0


async def becomes_ready(it):
    """Wait until nothing stands against a take-off; an old landing plan does not, though it blocks arming."""
    for _ in range(100):
        answer = await it.do("check_ready")
        if answer["ready"]:
            return
        await asyncio.sleep(2.0)
    raise AssertionError(f"not ready: {[each for each in answer['checks'] if not each['ok']]}")


async def begins_to_move(it):
    """Get ready, and go up where it flies."""
    await it.until(lambda: it.robot.is_connected and it.state.home_altitude is not None, LONG)
    if not it.state.armed:
        await becomes_ready(it)
    await it.until(lambda: set(vehicle(it).flavour.settings) <= {"Q_GUIDED_MODE", *it.state.settings}, LONG)
    if it.state.on_the_surface:
        await it.do("arm")
    else:
        await it.do("takeoff", altitude=HEIGHT)


async def is_held(it):
    """See it change to its hold and stand there, or go round where it is."""
    where = it.state.position
    anchor = GeoOrigin(where.latitude, where.longitude)
    await it.until(lambda: mode(it) == vehicle(it).flavour.hold, 5.0)
    if not isinstance(vehicle(it).flavour, Winged):
        await it.until(lambda: speed(it) < 0.7, 30.0)
        return
    began = vehicle(it).now()
    while vehicle(it).now() - began < 30.0:
        away = world_from_geo(anchor, it.state.position).horizontal()
        assert away < 2 * vehicle(it).flavour.reach(it.state) + 40.0, f"it went on {away:.0f} m"
        await asyncio.sleep(1.0)


async def is_paused_while_the_edge_moves_it(it, station):
    """Send it far by the edge."""
    await begins_to_move(it)
    far = GoTo(Goal(position=Vector3(0.0, FAR, HEIGHT)))
    going = asyncio.ensure_future(anext(aiter(it.adapter.navigate(far))))
    await it.until(lambda: speed(it) > 2.0, LONG)
    await going
    await asyncio.sleep(3.0)
    station.pause(it)
    await is_held(it)
    await it.until(lambda: it.robot.losses, 5.0)


async def is_paused_while_the_station_moves_it(it, station):
    """Send it far by the station."""
    station.send_far(it)
    await it.until(lambda: mode(it) == vehicle(it).flavour.goto and speed(it) > 2.0, LONG)
    await asyncio.sleep(3.0)
    station.pause(it)
    await is_held(it)


async def is_taken_back_and_goes_home(it, _station):
    await it.adapter.stop("hover")
    await it.do("return_to_home")


STEPS = (
    is_paused_while_the_edge_moves_it,
    is_paused_while_the_station_moves_it,
    is_taken_back_and_goes_home,
)
