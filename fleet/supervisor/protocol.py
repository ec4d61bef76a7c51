"""Protocol between a supervisor and the processes with robots: one JSON message per packet.

The transport is a Unix packet socket (SOCK_SEQPACKET) in the runtime folder, accessible to this user only.
``RegisterHalt`` and ``LeftNotice`` come with a file descriptor.
"""

from __future__ import annotations

import msgspec

from fleet.runtime.decoding import decode_with, json_decoder

LONGEST = 65536  # bytes of a message
LONGEST_REASON = 200  # characters of a stop's reason, and of its request


class Hello(msgspec.Struct, tag="hello", frozen=True):
    """First message of a process with robots. ``worker`` is empty for the edge's own process."""

    edge: str
    worker: str = ""
    process: int = 0


class StopRequest(msgspec.Struct, tag="stop", frozen=True):
    """An emergency stop for robots or groups by name; no name means all. ``StopAnswer`` repeats ``number``.

    ``why`` is the sender's reason, ``request`` its id: the same stop may also arrive over the bus. ``by`` is
    the user of the sending process; the supervisor sets it from the socket, whatever was sent.
    """

    names: tuple[str, ...] = ()
    number: int = 0
    why: str = ""
    request: str = ""
    by: str = ""


class Welcome(msgspec.Struct, tag="welcome", frozen=True):
    """The answer to ``Hello``: the stops that were requested while no edge was running."""

    stops: tuple[StopRequest, ...] = ()


class RegisterHalt(msgspec.Struct, tag="keep", frozen=True):
    """The frames that halt a robot; the descriptor of the link to write them to comes with the message.

    ``address``: destination of datagrams. ``HaltRegistered`` repeats ``number``.
    """

    robot: str
    frames: tuple[bytes, ...]
    address: tuple[str | int, ...] | None = None
    number: int = 0


class HaltRegistered(msgspec.Struct, tag="kept", frozen=True):
    """The answer to ``RegisterHalt``: the frames are written if the process dies. A refusal has no answer."""

    number: int


class UnregisterHalt(msgspec.Struct, tag="drop", frozen=True):
    """Forget a robot's frames and close the descriptor: the process closes the link in order."""

    robot: str
    number: int = 0


class HaltUnregistered(msgspec.Struct, tag="dropped", frozen=True):
    """The answer to ``UnregisterHalt``: the supervisor no longer has the link open."""

    number: int


class EdgeRunning(msgspec.Struct, tag="running", frozen=True):
    """The edge serves its robots; from now on it is restarted if it dies."""


class LeftNotice(msgspec.Struct, tag="farewell", frozen=True):
    """Disconnect notice for the cloud, to send if the edge dies; its file's descriptor comes with it."""


class OrderlyEnd(msgspec.Struct, tag="ended", frozen=True):
    """The edge ends on request."""


class ProcessHeartbeat(msgspec.Struct, tag="beat", frozen=True):
    """The process is not frozen."""


class WriteUntil(msgspec.Struct, tag="until", frozen=True):
    """Time (s since the computer's start) until which the process and the supervisor may write to robots."""

    until: float


class StopAnswer(msgspec.Struct, tag="stopped", frozen=True):
    """The answer to ``StopRequest``: the robots stopped; ``kept``: the stop also waits for the next edge."""

    number: int = 0
    edge: str = ""
    names: tuple[str, ...] = ()
    kept: bool = False


SupervisorMessage = (
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
    | WriteUntil
    | StopAnswer
)

_decoder: msgspec.json.Decoder[SupervisorMessage] = json_decoder(SupervisorMessage)
encode = msgspec.json.Encoder().encode


def decode(data: bytes) -> SupervisorMessage:
    """Decode a message; raises msgspec.DecodeError."""
    return decode_with(_decoder, data)
