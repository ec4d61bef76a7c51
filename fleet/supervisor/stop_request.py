"""Emergency stop through the supervisors; needs neither bus nor fleet.yaml, and imports very little."""

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

STOP_WITHIN = 5.0  # s within which a supervisor must answer a stop


def stop_all(
    directory: Path, names: tuple[str, ...] = (), *, why: str = "", request: str = ""
) -> list[StopAnswer]:
    """Emergency-stop robots through every supervisor of this user; returns their answers.

    No name means every robot, and so do more names than fit into a message. ``why`` is for the history,
    ``request`` identifies the same stop on the bus there; both are cut to length.
    """
    # A name that cannot be encoded must not prevent the stop of the others.
    named = tuple(name.encode(errors="replace").decode() for name in names)
    why, request = (text[:LONGEST_REASON].encode(errors="replace").decode() for text in (why, request))
    message = protocol.encode(StopRequest(named, why=why, request=request))
    if len(message) > LONGEST:
        message = protocol.encode(StopRequest(why=why, request=request))
    requested = []
    for path in sockets_in(directory):
        try:
            sock = connected(path, within=STOP_WITHIN)
            requested.append(sock)
            sock.send(message)
        except ConnectionRefusedError:  # the socket of a dead supervisor
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        except OSError as error:
            log.error("the supervisor at %s cannot be reached: %s", path, error.strerror or error)  # noqa: TRY400
    return [answer for sock in requested if (answer := _answer(sock)) is not None]


def _answer(sock: socket.socket) -> StopAnswer | None:
    """Return a supervisor's answer, None when it does not arrive in time."""
    with sock:
        try:
            answer = protocol.decode(sock.recv(LONGEST))
        except (OSError, msgspec.DecodeError):
            return None
    return answer if isinstance(answer, StopAnswer) else None
