"""A vehicle that serves files, over a link that loses what a test says."""

import struct

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.event_messages import FileTransfer
from fleet_mavlink.sim.files import SimFiles

HEAD = struct.Struct("<HBBBBBxI")
TERMINATE, OPEN, READ, CRC = 1, 4, 5, 14
PATH, DATA = "etc/events", bytes(range(256)) * 4


class Server:
    """The files of a simulated autopilot; ``loses`` says of each request, by its count, what gets lost."""

    def __init__(self, files=None):
        self.files = SimFiles({PATH: DATA} if files is None else files)
        self.loses = lambda _count, _opcode: None
        self.requests = []  # (sequence, opcode, offset)

    def answer(self, message):
        if not isinstance(message, FileTransfer):
            return []
        sequence, _, opcode, _, _, _, offset = HEAD.unpack_from(bytes(message.payload))
        self.requests.append((sequence, opcode, offset))
        lost = self.loses(len(self.requests), opcode)
        if lost == "request":
            return []
        asked = mav.MAVLink_file_transfer_protocol_message(0, 1, 1, list(message.payload))
        said = [FileTransfer(0, 0, 0, tuple(each.payload)) for each in self.files.requested(asked)]
        return [] if lost == "answer" else said

    def asked(self, opcode):
        return [request for request in self.requests if request[1] == opcode]

    @property
    def is_closed(self):
        return self.files._open is None
