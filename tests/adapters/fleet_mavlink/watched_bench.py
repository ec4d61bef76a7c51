"""A vehicle that a ground station sees through the edge, and what reaches each of them."""

import logging
from types import SimpleNamespace

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.authentication import FrameAuthentication
from fleet_mavlink.codec import Frame
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.signing import Signer, key_of
from fleet_mavlink.watched_vehicle import WatchedVehicle
from fleet_mavlink.watcher_config import WatcherConfig

STATION = "udpout:10.0.0.5:14550"
OFFBOARD = 0x00060000


def long(command, *params, system=1):
    return mav.MAVLink_command_long_message(system, 1, command, 0, *(*params, *([0.0] * (7 - len(params)))))


class WatchedBench:
    """A vehicle on PX4 that a station sees; ``passed`` reached it, ``shown`` the station."""

    def __init__(self, harness, *, may="operate", station=255, key=None):
        self.it = harness("px4")
        vehicle = self.vehicle = self.it.vehicle
        if key is not None:
            vehicle.trust = FrameAuthentication(Signer(key_of(key), self.it.clock.time))
        self.passed, self.frames, self.lost, self.halts, self.stopped = [], [], [], 0, False
        self.authority = SimpleNamespace(
            lose_to=lambda who, mode: self.lost.append((who, mode)),
            armed_by=lambda who: self.lost.append((who, "arms")),
        )
        self.link = SimpleNamespace(send=lambda frame, address: self.passed.append(frame))
        self.watched = WatchedVehicle(
            WatcherConfig(link=STATION, may=may, station=station),
            SimpleNamespace(show=self.frames.append),
            SimpleNamespace(system=245, component=191, link=self.link),
            vehicle,
            authority=self.authority,
            stopped=lambda: self.stopped,
            halt=self.halt,
            log=logging.getLogger("fleet.robot.kestrel"),
        )

    def halt(self):
        self.halts += 1

    def flies(self, mode=OFFBOARD):
        self.it.beat(mode=mode, armed=True)
        return self

    def send(self, message, *, system=255, component=190, key=None):
        packer = mav.MAVLink(None, srcSystem=system, srcComponent=component)
        if key is not None:
            packer.signing.secret_key, packer.signing.sign_outgoing = key_of(key), True
            packer.signing.timestamp = int((self.it.clock.time() - 1_420_070_400) * 1e5)
        raw = bytes(message.pack(packer))
        self.watched.handle_frame(
            Frame(system, component, CommandLong(1), signed=raw if key is not None else b"", raw=raw)
        )

    @property
    def shown(self):
        parser = mav.MAVLink(None)
        return [message for frame in self.frames for message in parser.parse_buffer(bytearray(frame)) or ()]

    def refusals(self, kind="COMMAND_ACK"):
        return [message for message in self.shown if message.get_type() == kind]

    @property
    def reasons(self):
        return "".join(message.text for message in self.shown if message.get_type() == "STATUSTEXT")
