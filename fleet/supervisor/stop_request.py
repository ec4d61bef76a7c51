"""Asking supervisors for an emergency stop; needs neither bus nor fleet.yaml, imports next to nothing."""

from __future__ import annotations

import contextlib
import logging
import socket
from pathlib import Path

import msgspec

from fleet.supervisor import protocol
from fleet.supervisor.protocol import LONGEST, LONGEST_REASON, StopAnswer, StopRequest
from fleet.supervisor.sockets import connected, sockets_in

log = logging.getLogger(__name__)

STOP_WITHIN = 5.0  # s that a supervisor has to answer a stop


def stop_all(
    directory: Path, names: tuple[str, ...] = (), *, why: str = "", request: str = ""
) -> list[StopAnswer]:
    """Emergency-stop robots through every supervisor of this user; returns their answers.

    Needs neither the bus nor fleet.yaml. No name means every robot, and so do more than fit a message.
    ``why`` is for the history, ``request`` tells there that the stop on the bus is this one; both are cut.
    """
    # A name that is no text must not hold up the others.
    named = tuple(name.encode(errors="replace").decode() for name in names)
    why, request = (text[:LONGEST_REASON].encode(errors="replace").decode() for text in (why, request))
    message = protocol.encode(StopRequest(named, why=why, request=request))
    if len(message) > LONGEST:
        message = protocol.encode(StopRequest(why=why, request=request))
    asked = []
    for path in sockets_in(directory):
        try:
            sock = connected(path, within=STOP_WITHIN)
            asked.append(sock)
            sock.send(message)
        except ConnectionRefusedError:  # a dead one's
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        except OSError as error:
            log.error("the supervisor at %s cannot be reached: %s", path, error.strerror or error)  # noqa: TRY400
    return [answer for sock in asked if (answer := _answer(sock)) is not None]


def _answer(sock: socket.socket) -> StopAnswer | None:
    """Return a supervisor's answer, None for none in time."""
    with sock:
        try:
            answer = protocol.decode(sock.recv(LONGEST))
        except (OSError, msgspec.DecodeError):
            return None
    return answer if isinstance(answer, StopAnswer) else None
