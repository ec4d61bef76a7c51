"""Links to the console, handed out on a Unix socket that only this user can open.

A link is ``http://127.0.0.1:PORT/#token=...``: browsers do not send the part after ``#`` to any server, and
it is in no log. The page exchanges it at once for a cookie. So a link is requested when it is needed, and
works once.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import msgspec

from fleet.console.task import link_sockets
from fleet.errors import FleetError
from fleet.model.permission import Permission
from fleet.runtime.decoding import decode_json

ANSWER_WITHIN = 2.0  # s
LONGEST = 4096  # bytes of a message


class ConsoleError(FleetError):
    """The console cannot be served, or does not answer."""


class LinkRequest(msgspec.Struct, frozen=True):
    """Request for a link for an operator with a permission, or for an address for Foxglove."""

    operator: str
    permission: Permission
    to: Literal["page", "foxglove"] = "page"


class LinkGiven(msgspec.Struct, frozen=True):
    """The link, and the process id of its console."""

    link: str
    process: int


async def serve_links(path: Path, make: Callable[[LinkRequest], str]) -> asyncio.AbstractServer:
    """Serve links at a socket path; raises ConsoleError if another console has it."""
    listener = _bound(path)
    if answers(path):
        raise ConsoleError(
            f"a console of this name runs already: {path.name}; its link: fleet console --link"
        )

    async def requested(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, msgspec.DecodeError, ValueError, TimeoutError):
            async with asyncio.timeout(ANSWER_WITHIN):
                line = await reader.readline()
            link = make(decode_json(line, LinkRequest))
            writer.write(msgspec.json.encode(LinkGiven(link, os.getpid())) + b"\n")
            await writer.drain()
        writer.close()

    return await asyncio.start_unix_server(requested, sock=listener, limit=LONGEST)


def _bound(path: Path) -> socket.socket:
    """Return a socket at a path that only this user can open; raises ConsoleError."""
    if answers(path):
        raise ConsoleError(f"a console named {path.stem} runs already; its link: fleet console --link")
    listener = socket.socket(socket.AF_UNIX)
    try:
        path.unlink(missing_ok=True)
        listener.bind(str(path))
        path.chmod(0o600)
    except OSError as error:
        listener.close()
        raise ConsoleError(f"{path} cannot be opened: {error.strerror or error}") from None
    return listener


def answers(path: Path) -> bool:
    """Return True if a process listens on the socket at a path."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        return probe.connect_ex(str(path)) == 0


def request_link(path: Path, requested: LinkRequest) -> LinkGiven | None:
    """Return a new link of the console at a path; None without an answer. Blocks."""
    with contextlib.suppress(OSError, msgspec.DecodeError, ValueError), socket.socket(socket.AF_UNIX) as sock:
        sock.settimeout(ANSWER_WITHIN)
        sock.connect(str(path))
        sock.sendall(msgspec.json.encode(requested) + b"\n")
        with sock.makefile("rb") as answer:
            return decode_json(answer.readline(LONGEST), LinkGiven)
    return None


def all_links(directory: Path, requested: LinkRequest) -> dict[str, str]:
    """Return a new link of each console of this user, by name. Blocks."""
    found = {}
    for path in link_sockets(directory):
        given = request_link(path, requested)
        if given is not None:
            found[path.name.removeprefix("console-").removesuffix(".sock")] = given.link
    return found
