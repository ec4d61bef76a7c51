"""What a supervisor and the processes with robots say to each other, one JSON message a packet.

The way is a Unix socket of packets (SOCK_SEQPACKET) in the runtime folder, for this user alone.
``RegisterHalt`` comes with a file descriptor.
"""

from __future__ import annotations

import msgspec

from fleet.runtime.decoding import json_decoder

LONGEST = 65536  # bytes of a message
LONGEST_REASON = 200  # characters of a stop's reason, and of its request


class Hello(msgspec.Struct, tag="hello", frozen=True):
    """A process with robots is there. ``worker`` is empty for the edge's own process."""

    edge: str
    worker: str = ""
    process: int = 0


class StopRequest(msgspec.Struct, tag="stop", frozen=True):
    """An emergency stop for robots or groups by name; no name means all. ``number`` comes back in Stopped.

    ``why`` is the asker's reason, ``request`` its id: the same stop may come by the bus as well. ``by`` is
    the user whose process asked, as the supervisor saw it at the socket, whatever was sent.
    """

    names: tuple[str, ...] = ()
    number: int = 0
    why: str = ""
    request: str = ""
    by: str = ""


class Welcome(msgspec.Struct, tag="welcome", frozen=True):
    """The answer to Hello: the stops that came while no edge was there to take them."""

    stops: tuple[StopRequest, ...] = ()


class RegisterHalt(msgspec.Struct, tag="keep", frozen=True):
    """The frames that halt a robot, and with the message the descriptor of the link to write them to.

    ``address``: to whom, for datagrams. ``number`` comes back in Kept.
    """

    robot: str
    frames: tuple[bytes, ...]
    address: tuple[str | int, ...] | None = None
    number: int = 0


class HaltRegistered(msgspec.Struct, tag="kept", frozen=True):
    """The answer to Keep: the frames are written if the process dies. What is refused has no answer."""

    number: int


class UnregisterHalt(msgspec.Struct, tag="drop", frozen=True):
    """Forget a robot's frames and close the descriptor: the link is closed in order."""

    robot: str
    number: int = 0


class HaltUnregistered(msgspec.Struct, tag="dropped", frozen=True):
    """The answer to Drop: nobody else has the link open any more."""

    number: int


class EdgeRunning(msgspec.Struct, tag="running", frozen=True):
    """The edge serves its robots; from now on its death is followed by a new start."""


class LeftNotice(msgspec.Struct, tag="farewell", frozen=True):
    """What the cloud is to be told when the edge dies; the descriptor of its file comes with the message."""


class OrderlyEnd(msgspec.Struct, tag="ended", frozen=True):
    """The edge ends because somebody asked it to."""


class ProcessHeartbeat(msgspec.Struct, tag="beat", frozen=True):
    """The process is not frozen."""


class StopAnswer(msgspec.Struct, tag="stopped", frozen=True):
    """The answer to Stop: who was told, and whether it is kept for an edge that is not there now."""

    number: int = 0
    edge: str = ""
    names: tuple[str, ...] = ()
    kept: bool = False


Message = (
    Hello
    | StopRequest
    | Welcome
    | RegisterHalt
    | HaltRegistered
    | UnregisterHalt
    | HaltUnregistered
    | EdgeRunning
    | LeftNotice
    | OrderlyEnd
    | ProcessHeartbeat
    | StopAnswer
)

_decoder: msgspec.json.Decoder[Message] = json_decoder(Message)
encode = msgspec.json.Encoder().encode


def decode(data: bytes) -> Message:
    """Decode a message; raises msgspec.DecodeError."""
    return _decoder.decode(data)
