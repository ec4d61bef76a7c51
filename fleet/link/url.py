"""Link URLs of fleet.yaml: parse, check, open.

udpin:0.0.0.0:14550                     listen, and answer the last peer heard
udpout:192.168.1.10:14550               send first, to this peer only
tcp:192.168.1.10:5760
serial:/dev/serial/by-id/...?baud=57600
can:socketcan:can0                      a CAN bus by python-can's interface and channel
memory:NAME                             a robot in this process, for tests
"""

from __future__ import annotations

import contextlib
import contextvars
import importlib.util
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Annotated

import msgspec
from pydantic import AfterValidator

from fleet.errors import LinkRefused
from fleet.link import memory, serial, tcp, udp
from fleet.link.base import Link, Receiver
from fleet.link.gate import GATE, GatedLink

EXAMPLES = {
    "udpin": "udpin:0.0.0.0:14550",
    "udpout": "udpout:192.168.1.10:14550",
    "tcp": "tcp:192.168.1.10:5760",
    "serial": "serial:/dev/ttyUSB0?baud=115200",
    "can": "can:socketcan:can0",
    "memory": "memory:rover",
}
_HOST_AND_PORT = re.compile(
    r"(?:\[(?P<six>[0-9a-fA-F:.%\w]+)\]|(?P<host>[A-Za-z0-9._-]+)):(?P<port>\d{1,5})", re.ASCII
)
_DEVICE = re.compile(r"(?P<path>/[^?\s]+)\?baud=(?P<baud>[1-9]\d{1,7})", re.ASCII)
_NAME = re.compile(r"[\w.-]+", re.ASCII)


class LinkUrl(msgspec.Struct, frozen=True):
    """Parsed link URL: ``host`` and ``port``, or ``path`` (device, or memory name) and ``baud``."""

    text: str
    scheme: str
    host: str = ""
    port: int = 0
    path: str = ""
    baud: int = 0


def parse_link_url(url: str) -> LinkUrl:
    """Parse a link URL; raises LinkRefused with a correct example."""
    scheme, colon, rest = url.partition(":")
    if scheme == "sim":
        raise LinkRefused(f"{url!r}: this kind of robot has no simulator; use one of {_schemes()}")
    if not colon or scheme not in EXAMPLES:
        raise LinkRefused(f"{url!r} is not a link; begin it with one of {_schemes()}")
    if scheme == "serial":
        return _device(url, rest)
    if scheme == "can":
        return _bus(url)
    if scheme == "memory":
        if not _NAME.fullmatch(rest):
            raise _malformed(url, "the name has letters, digits, '.', '_' and '-'")
        return LinkUrl(url, scheme, path=rest)
    return _network(url, scheme, rest)


def _schemes() -> str:
    """Return the known schemes as text."""
    return ", ".join(f"{scheme}:" for scheme in EXAMPLES)


def _malformed(url: str, reason: str) -> LinkRefused:
    """Return the error for a malformed URL of a known scheme."""
    return LinkRefused(f"{url!r}: {reason}; write it like {EXAMPLES[url.partition(':')[0]]}")


def _network(url: str, scheme: str, rest: str) -> LinkUrl:
    """Parse HOST:PORT; port 0 (any free port) is only for listening."""
    match = _HOST_AND_PORT.fullmatch(rest)
    if match is None:
        raise _malformed(url, "expected HOST:PORT (an IPv6 address in brackets)")
    port = int(match["port"])
    if port > 65535 or (port == 0 and scheme != "udpin"):
        raise _malformed(url, f"port {port} is not in 1 to 65535")
    return LinkUrl(url, scheme, host=match["six"] or match["host"], port=port)


def _device(url: str, rest: str) -> LinkUrl:
    """Parse PATH?baud=N. The baud rate has no default: a wrong one shows only as silence."""
    match = _DEVICE.fullmatch(rest)
    if match is None:
        raise _malformed(url, "expected an absolute device path and its speed, nothing else")
    return LinkUrl(url, "serial", path=match["path"], baud=int(match["baud"]))


def _bus(url: str) -> LinkUrl:
    """Check the URL of a CAN bus; python-can defines its parts."""
    if importlib.util.find_spec("can") is None:
        raise LinkRefused(f"{url!r}: CAN needs python-can: pip install 'zenoh-fleet[can]'")
    from fleet.link.canbus.bus import parse_link  # noqa: PLC0415 - optional dependency

    parse_link(url)
    return LinkUrl(url, "can", path=url)


async def _open_can(url: str, receiver: Receiver) -> Link:
    from fleet.link.canbus.link import open_can  # noqa: PLC0415 - optional dependency

    return await open_can(url, receiver)


def _checked(text: str) -> str:
    """Return the text of a valid link URL; raises ValueError, which pydantic reports with its position."""
    try:
        parse_link_url(text)
    except LinkRefused as error:
        raise ValueError(str(error)) from None
    return text


LinkText = Annotated[str, AfterValidator(_checked)]
"""Type of a ``link`` field in an adapter's config; checked when fleet.yaml is loaded."""

_OPENERS: dict[str, Callable[[LinkUrl, Receiver], Awaitable[Link]]] = {
    "udpin": lambda url, receiver: udp.open_listening(url.text, url.host, url.port, receiver),
    "udpout": lambda url, receiver: udp.open_speaking(url.text, url.host, url.port, receiver),
    "tcp": lambda url, receiver: tcp.open_tcp(url.text, url.host, url.port, receiver),
    "serial": lambda url, receiver: serial.open_serial(url.text, url.path, url.baud, receiver),
    "can": lambda url, receiver: _open_can(url.text, receiver),
    "memory": lambda url, receiver: memory.open_memory(url.text, url.path, receiver),
}


OPENER: contextvars.ContextVar[Callable[[str, Receiver], Awaitable[Link]] | None] = contextvars.ContextVar(
    "opener", default=None
)
"""Replacement that opens links in a replay; None: real links are opened."""


async def open_link(url: str, receiver: Receiver) -> Link:
    """Open a link; ``receiver(data, address)`` is called on this loop with received bytes; must not raise.

    Raises LinkRefused when a person must act (bad URL, port in use, no permission, missing extra) and
    LinkLost when a retry may succeed (no answer, device not plugged in).
    """
    opener = OPENER.get()
    if opener is not None:
        return await opener(url, receiver)
    parts = parse_link_url(url)
    gate = GATE.get()
    if gate is None:
        return await _OPENERS[parts.scheme](parts, receiver)
    epoch = gate.epoch
    gate.check(epoch, url)
    return GatedLink(await _OPENERS[parts.scheme](parts, receiver), gate, epoch)


@contextlib.asynccontextmanager
async def opened_link(url: str, receiver: Receiver) -> AsyncIterator[Link]:
    """Open a link as ``open_link`` does and close it at the end; for use with ``robot.enter``."""
    link = await open_link(url, receiver)
    try:
        yield link
    finally:
        await link.close()
