"""Minimal simulation of many flying ArduPilot vehicles: packed frames sent at ArduPilot's rates.

``python -m bench.swarm COUNT PORT NOTES``: systems 1 to COUNT send to 127.0.0.1:PORT, accept every command
and change mode as commanded. Each arriving command is reported to NOTES in a datagram: monotonic time, system
ID, command ID. The time is the kernel's timestamp of the write to the socket, because the swarm may read it
late.
"""

import contextlib
import socket
import struct
import sys
import time

from pymavlink.dialects.v20 import all as mav

TICK = 0.02
RATES = {0: 1, 1: 1, 2: 1, 24: 1, 30: 10, 33: 10, 42: 0.5, 147: 0.5, 193: 1, 242: 1, 245: 2}  # ID -> Hz
ARDUPILOT, GUIDED, ARMED = 3, 4, 0x81
SO_TIMESTAMPNS = 35  # Linux; missing from the socket module
STAMP = struct.Struct("qq")  # seconds, nanoseconds
COMMAND_INT, COMMAND_LONG, DO_SET_MODE = 75, 76, 176


def frames(system):
    """Return one packed frame of each message of an aircraft 20 m above its home."""
    sender = mav.MAVLink(None, srcSystem=system, srcComponent=1)
    place = (473977420 + system * 1000, 85455940)
    messages = (
        mav.MAVLink_sys_status_message(0, 0, 0x10000000, 0, 12000, 1000, 80, 0, 0, 0, 0, 0, 0),
        mav.MAVLink_system_time_message(0, 60_000),
        mav.MAVLink_gps_raw_int_message(0, 6, *place, 508_000, 80, 80, 0, 0, 12),
        mav.MAVLink_attitude_message(60_000, 0.01, 0.02, 1.0, 0, 0, 0),
        mav.MAVLink_global_position_int_message(60_000, *place, 508_000, 20_000, 0, 0, 0, 9000),
        mav.MAVLink_mission_current_message(0, 0),
        mav.MAVLink_battery_status_message(0, 1, 1, 32767, [12000] + [65535] * 9, 1000, 100, -1, 80),
        mav.MAVLink_ekf_status_report_message(0x33F, 0, 0, 0, 0, 0),
        mav.MAVLink_home_position_message(*place, 488_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
        mav.MAVLink_extended_sys_state_message(0, 2),
    )
    return {0: beat(system, GUIDED), **{each.get_msgId(): bytes(each.pack(sender)) for each in messages}}


def beat(system, mode):
    """Return an armed HEARTBEAT."""
    sender = mav.MAVLink(None, srcSystem=system, srcComponent=1)
    return bytes(mav.MAVLink_heartbeat_message(2, ARDUPILOT, ARMED, mode, 4, 3).pack(sender))


class Swarm:
    """All aircraft on one socket."""

    def __init__(self, count, port, notes):
        self.to, self.notes = ("127.0.0.1", port), ("127.0.0.1", notes)
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.bind(("127.0.0.1", 0))
        self.link.setblocking(False)
        self.link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.link.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.frames = {system: frames(system) for system in range(1, count + 1)}
        now = time.monotonic()
        self.due = [
            [now + number / count / rate, system, kind, 1 / rate]
            for number, system in enumerate(self.frames)
            for kind, rate in RATES.items()
        ]

    def run(self):
        """Send due frames and answer commands until killed."""
        parser = mav.MAVLink(None, srcSystem=1, srcComponent=1)
        parser.robust_parsing = True
        while True:
            now = time.monotonic()
            for entry in self.due:
                if entry[0] <= now:
                    entry[0] += entry[3]
                    self.link.sendto(self.frames[entry[1]][entry[2]], self.to)
            until = now + TICK
            while time.monotonic() < until:
                self.receive(parser)
                time.sleep(0.0005)

    def receive(self, parser):
        """Read everything that has arrived, with timestamps, before answering any of it."""
        arrived = []
        with contextlib.suppress(BlockingIOError):
            while True:
                data, ancillary, *_ = self.link.recvmsg(4096, 64)
                arrived.append((data, written_at(ancillary)))
        for data, at in arrived:
            for message in parser.parse_buffer(data) or ():
                if message.get_msgId() in {COMMAND_INT, COMMAND_LONG}:
                    self.execute(message, at)

    def execute(self, message, at):
        """Report a command, acknowledge it, and change mode."""
        system = message.target_system
        self.link.sendto(f"{at} {system} {message.command}".encode(), self.notes)
        source = message.get_srcSystem(), message.get_srcComponent()
        sender = mav.MAVLink(None, srcSystem=system, srcComponent=1)
        ack = mav.MAVLink_command_ack_message(message.command, 0, 0, 0, *source)
        self.link.sendto(bytes(ack.pack(sender)), self.to)
        if message.command == DO_SET_MODE and system in self.frames:
            self.frames[system][0] = beat(system, int(message.param2))
            self.link.sendto(self.frames[system][0], self.to)


def written_at(ancillary):
    """Return the monotonic time of a datagram from its ancillary data."""
    seconds, nanoseconds = STAMP.unpack(ancillary[0][2][: STAMP.size])
    return seconds + nanoseconds / 1e9 - time.time() + time.monotonic()


if __name__ == "__main__":
    Swarm(*map(int, sys.argv[1:])).run()
