"""A CAN bus over python-can: opens, reads and writes it, and gives it up when it is dead.

can:socketcan:can0
can:udp_multicast:239.74.163.2?port=43113
can:slcan:/dev/ttyACM0
can:socketcand:can0?host=192.168.1.20&port=29536
can:kvaser:0
can:virtual:NAME

The link of one robot also has the bit rates: can:kvaser:0?bitrate=500000&data_bitrate=2000000 (CAN FD).

A frame that cannot be sent is dropped: a newer one follows in the next cycle. A transmit queue that stays
full means that no node acknowledges. Its frames would be sent when power returns, so the bus is given up.
"""

from __future__ import annotations

import contextlib
import errno
import math
import re
import socket
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

import can
from can.interfaces.socketcan import SocketcanBus
from pydantic import AfterValidator

from fleet.clock import Clock
from fleet.errors import LinkLost, LinkRefused
from fleet.link.canbus import raw
from fleet.link.canbus.frame import CanFrame, is_foreign
from fleet.link.canbus.raw import Packet

_URL = re.compile(r"can:(?P<interface>[a-z0-9_]+):(?P<channel>[^?\s]+)(?:\?(?P<options>\S+))?", re.ASCII)
_OPTION = re.compile(r"(?:host=[A-Za-z0-9.:_-]+|port=\d{1,5}|(?:data_)?bitrate=[1-9]\d{3,7})", re.ASCII)
_OPTIONS_OF: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"udp_multicast": ("port",), "socketcand": ("host", "port")}
)
"""The options of each interface; all others have none."""
_NO_BITRATE = frozenset({"socketcan", "udp_multicast", "socketcand", "virtual"})
"""Interfaces whose bit rate is set elsewhere (``ip link``, the daemon) or that have none."""
_SOCKETCAND_PORT = 29536  # default of the daemon
_PCAN_CLOCK = 80_000_000  # Hz, of the PCAN interfaces with CAN FD
_CONNECT_TIMEOUT = 2.0  # s within which a daemon's host must answer
_RATES = ("bitrate", "data_bitrate")
_BLOCKED = 0.01  # s that a bus counts as blocked after its queue was full
_DEAD_AFTER = 0.1  # s of a full queue after which the bus is dead
_BATCH = 256  # frames read at once
_BUS_OFF = 0x40  # bit in the identifier of a SocketCAN error frame
_PERMANENT_ERRORS = {errno.ENODEV, errno.EACCES, errno.EPERM, errno.EAFNOSUPPORT}


_OPEN_ERRORS = (
    can.CanError,
    OSError,
    ValueError,
    ImportError,
    TypeError,
    NameError,
    AttributeError,
    RuntimeError,
)
"""Errors of python-can's interfaces when a bus cannot be opened, including a vendor's missing driver."""


class BusUrl(NamedTuple):
    """A parsed bus URL: python-can's interface and channel; host and port of a daemon, or multicast port.

    ``bitrate`` and ``data_bitrate`` (bit/s) are those of a link; the second selects CAN FD.
    """

    interface: str
    channel: str
    port: int | None = None
    host: str = ""
    bitrate: int | None = None
    data_bitrate: int | None = None


def parse_bus(text: str) -> BusUrl:
    """Return the parts of a bus URL without bit rates; raises LinkRefused with an example."""
    return _parse(text, rates=False)


def parse_link(text: str) -> BusUrl:
    """Return the parts of a robot's link, with its bit rates; raises LinkRefused with an example."""
    parts = _parse(text, rates=True)
    if parts.bitrate is None and parts.interface not in _NO_BITRATE:
        example = f"can:{parts.interface}:{parts.channel}?bitrate=500000"
        raise LinkRefused(f"{text!r} names no bit rate; write it like {example}")
    return parts


def _parse(text: str, *, rates: bool) -> BusUrl:
    match = _URL.fullmatch(text)
    if match is None:
        raise LinkRefused(f"{text!r} is not a bus; write it like can:socketcan:can0")
    if match["interface"] not in can.VALID_INTERFACES:
        raise LinkRefused(f"{text!r}: python-can has no interface {match['interface']!r}")
    interface, given = (
        match["interface"],
        _options(text, match["interface"], match["options"] or "", rates=rates),
    )
    port = int(given["port"]) if "port" in given else None
    if port is not None and not 0 < port < 65536:
        raise LinkRefused(f"{text!r}: there is no port {port}")
    if interface == "socketcand" and "host" not in given:
        raise LinkRefused(f"{text!r} names no host; write it like can:socketcand:can0?host=192.168.1.20")
    bitrates = [int(given[name]) if name in given else None for name in _RATES]
    return BusUrl(interface, match["channel"], port, given.get("host", ""), *bitrates)


def _options(text: str, interface: str, options: str, *, rates: bool) -> dict[str, str]:
    """Return the options of a bus URL; raises LinkRefused for one that its interface does not have."""
    takes, given = _OPTIONS_OF.get(interface, ()), {}
    if rates and interface != "socketcand":
        takes = (*takes, *(_RATES[1:] if interface in _NO_BITRATE else _RATES))
    for option in options.split("&") if options else ():
        name, _, value = option.partition("=")
        if _OPTION.fullmatch(option) is None or name not in takes or name in given:
            known = f"it takes {' and '.join(takes)}" if takes else "it takes none"
            raise LinkRefused(f"{text!r}: {option!r} is no option of {interface}; {known}")
        given[name] = value
    return given


def _checked(text: str) -> str:
    try:
        parse_bus(text)
    except LinkRefused as error:
        raise ValueError(str(error)) from None
    return text


BusText = Annotated[str, AfterValidator(_checked)]
"""Type of a bus in an adapter's config; checked when fleet.yaml is loaded."""


class OpenCanBus:
    """One open bus. ``dropped`` counts frames that could not be sent, ``errors`` error frames.

    ``data_bitrate`` (bit/s) selects CAN FD.
    """

    def __init__(
        self, name: str, url: str, bitrate: int, clock: Clock, data_bitrate: int | None = None
    ) -> None:
        self.name = name
        self.url = url
        self.dropped = 0
        self.errors = 0
        self._clock = clock
        self._full_since: float | None = None
        self._full_at = -math.inf
        self._dead = ""
        self._bus: can.BusABC | None = _open(url, bitrate, data_bitrate)
        self._socket = _socket_of(self._bus)

    @property
    def dead(self) -> str:
        """Why the bus is dead; empty while it works."""
        return self._dead

    @property
    def blocked(self) -> bool:
        """True shortly after its transmit queue was full."""
        return self._clock.monotonic() - self._full_at < _BLOCKED

    def send(self, frame: CanFrame) -> None:
        """Send a frame, or drop and count it. A dead bus sends nothing."""
        bus = self._bus
        if bus is None or self._dead:
            return
        try:
            if self._socket is not None:
                raw.write(self._socket, frame)
            else:
                bus.send(_message(frame), timeout=0)
        except (can.CanError, OSError) as error:
            self.dropped += 1
            self._failed(error)
        else:
            self._full_since = None

    def receive(self, wait: float) -> list[CanFrame]:
        """Return the received frames, waiting up to ``wait`` s for the first; raises LinkLost."""
        frames: list[CanFrame] = []
        try:
            for packet in self._packets(wait):
                self._classify(packet, frames)
                if self._dead:
                    break
        except (can.CanError, OSError) as error:
            self._dead = f"reading failed: {error}"
        if self._dead or self._bus is None:
            raise LinkLost(f"bus {self.name!r} ({self.url}): {self._dead or 'it is closed'}")
        return frames

    def close(self) -> None:
        """Close; frames in a hardware queue are discarded if the interface supports it."""
        bus, self._bus = self._bus, None
        if bus is None:
            return
        with contextlib.suppress(can.CanError, OSError, NotImplementedError):
            bus.flush_tx_buffer()
        with contextlib.suppress(can.CanError, OSError):
            bus.shutdown()

    def _packets(self, wait: float) -> Iterable[Packet]:
        """Return the received packets by the fastest method of the interface."""
        if self._bus is None or self._dead:
            return ()
        if self._socket is not None:
            return raw.read(self._socket, wait, _BATCH)
        return _received(self._bus, wait)

    def _classify(self, packet: Packet, frames: list[CanFrame]) -> None:
        """Keep data frames; count error frames and look for bus-off in them."""
        if packet.error:
            self.errors += 1
            if packet.frame.id & _BUS_OFF:
                self._dead = "bus-off: the controller has left the bus; check termination, bitrate and wiring"
        elif not packet.unwanted:
            frames.append(packet.frame)

    def _failed(self, error: Exception) -> None:
        """Decide whether a failed send means a full queue or a dead bus."""
        code = getattr(error, "error_code", None) or getattr(error, "errno", None)
        now = self._clock.monotonic()
        if code not in {None, errno.ENOBUFS, errno.EAGAIN}:
            self._dead = f"sending failed: {error}"
            return
        self._full_at = now
        if self._full_since is None:
            self._full_since = now
        elif now - self._full_since > _DEAD_AFTER:
            channel = _parse(self.url, rates=True).channel
            self._dead = (
                "its transmit queue stays full, no node acknowledges: are the drives powered? It may hold "
                "old targets: before power comes back run  "
                f"ip link set {channel} down; ip link set {channel} up"
            )


def _message(frame: CanFrame) -> can.Message:
    """Return a frame as a message of python-can."""
    return can.Message(
        arbitration_id=frame.id,
        data=None if frame.remote else frame.data,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        is_fd=frame.fd,
        bitrate_switch=frame.fd,
        check=False,
    )


def _received(bus: can.BusABC, wait: float) -> Iterator[Packet]:
    """Yield the packets that python-can has received, waiting up to ``wait`` s for the first."""
    for _ in range(_BATCH):
        message = bus.recv(wait)
        if message is None:
            return
        frame = CanFrame(message.arbitration_id, bytes(message.data), message.is_fd)
        unwanted = message.is_remote_frame or is_foreign(frame.id, extended=message.is_extended_id)
        yield Packet(frame, message.is_error_frame, unwanted)
        wait = 0.0


def _socket_of(bus: can.BusABC) -> socket.socket | None:
    """Return the kernel's CAN socket of a SocketCAN interface, None for others."""
    return bus.socket if isinstance(bus, SocketcanBus) else None


def _open(url: str, bitrate: int, data_bitrate: int | None) -> can.BusABC:
    """Open a bus; raises LinkRefused when a person must act, LinkLost when it may work later."""
    parts = _parse(url, rates=True)
    options: dict[str, Any] = {"interface": parts.interface, "channel": parts.channel}
    if parts.interface == "udp_multicast":
        options |= {"fd": data_bitrate is not None, "hop_limit": 0}
        if parts.port is not None:
            options["port"] = parts.port
    elif parts.interface == "socketcand":  # the daemon sets the bit rate
        if data_bitrate is not None:
            raise LinkRefused(
                f"{url}: a socketcand daemon carries no CAN FD; open the bus on its own computer"
            )
        options |= {"host": parts.host, "port": parts.port or _SOCKETCAND_PORT}
    elif parts.interface != "virtual":
        options["bitrate"] = bitrate
        options |= _fd_options(parts.interface, bitrate, data_bitrate)
    try:
        if parts.host:  # fail early: python-can retries for 10 s without a pause
            socket.create_connection((options["host"], options["port"]), _CONNECT_TIMEOUT).close()
        return can.Bus(**options)
    except _OPEN_ERRORS as error:
        raise _unopened(url, parts.interface, error) from error


def _fd_options(interface: str, bitrate: int, data_bitrate: int | None) -> dict[str, Any]:
    """Return python-can's options for CAN FD; SocketCAN has its bit rates from ``ip link``."""
    if data_bitrate is None:
        return {}
    if interface != "pcan":
        return {"fd": True, "data_bitrate": data_bitrate}
    timing = can.BitTimingFd.from_sample_point(
        f_clock=_PCAN_CLOCK,
        nom_bitrate=bitrate,
        nom_sample_point=80.0,
        data_bitrate=data_bitrate,
        data_sample_point=80.0,
    )
    return {"timing": timing}


def _unopened(url: str, interface: str, error: Exception) -> LinkLost | LinkRefused:
    """Return the error for a bus that cannot be opened: refused if a person must act, otherwise lost."""
    code = getattr(error, "error_code", None) or getattr(error, "errno", None)
    why = str(getattr(error, "strerror", None) or error)
    if isinstance(error, (ImportError, NameError, AttributeError, can.CanInterfaceNotImplementedError)):
        return LinkRefused(f"{url}: the driver for {interface} is not installed on this computer ({why})")
    if isinstance(error, (ValueError, TypeError)) or code in _PERMANENT_ERRORS:
        return LinkRefused(f"{url}: {why}")
    if type(error) is OSError and code is None:
        return LinkRefused(f"{url}: the driver for {interface} cannot be loaded ({why})")
    return LinkLost(f"{url}: {why}")
