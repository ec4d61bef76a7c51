"""Ports, broker and other edges' endpoints, which the edge must open and reach.

No port is bound, and no MQTT session is opened: a second one with the edge's name would end the first.
"""

from __future__ import annotations

import contextlib
import re
import socket
import ssl
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from fleet.config.schema import CloudConfig, Sections
from fleet.doctor.finding import Finding, error, ok, unknown, warning
from fleet.host.edge.certificate_expiry import ending

PORTS, BROKER, ENDPOINTS = "ports", "broker", "bus"
WITHIN = 3.0  # s for one connection
_UDP_LINK = re.compile(r"udpin:.*:(\d+)")
_LISTENING = {"tcp": "0A", "udp": "07"}  # states in /proc/net: LISTEN, and a bound UDP socket
_OF_PROTOCOL = {"tcp": "tcp", "tls": "tcp", "ws": "tcp", "udp": "udp", "quic": "udp"}
_ENDPOINT = re.compile(r"(tcp|tls|ws|udp|quic)/(.+):(\d+)(?:[?#].*)?")


class EdgePort(msgspec.Struct, frozen=True):
    """A port that the edge will open: ``protocol`` tcp or udp, and its name in fleet.yaml."""

    protocol: str
    number: int
    purpose: str


def ports_of(config: Sections, links: Iterable[str]) -> list[EdgePort]:
    """Return the ports that the edge opens by fleet.yaml, without 0 (any free port)."""
    found = [EdgePort("udp", int(match[1]), link) for link in links if (match := _UDP_LINK.fullmatch(link))]
    if config.metrics is not None:
        found.append(EdgePort("tcp", config.metrics.port, "metrics"))
    if config.console is not None:
        found.append(EdgePort("tcp", config.console.port, "console"))
        if config.console.endpoint is not None:
            found.append(EdgePort("tcp", config.console.endpoint[1], "console.listen"))
    found += [
        EdgePort(_OF_PROTOCOL[match[1]], int(match[3]), f"bus.listen {end}")
        for end in config.bus.listen
        if (match := _ENDPOINT.fullmatch(end))
    ]
    return [port for port in found if port.number]


def taken_ports(proc: Path = Path("/proc/net")) -> set[tuple[str, int]]:
    """Return the open ports of this computer, from the kernel's tables."""
    taken = set()
    for protocol, state in _LISTENING.items():
        for name in (protocol, f"{protocol}6"):
            with contextlib.suppress(OSError):
                rows = (line.split() for line in (proc / name).read_text().splitlines()[1:])
                taken |= {(protocol, int(row[1].rpartition(":")[2], 16)) for row in rows if row[3] == state}
    return taken


def check_ports(ports: Iterable[EdgePort], taken: set[tuple[str, int]], *, running: bool) -> list[Finding]:
    """Check that the ports are free, or, while the edge runs, that they are open."""
    wanted = list(ports)
    used = [port for port in wanted if (port.protocol, port.number) in taken]
    if running:
        missing = [port for port in wanted if port not in used]
        return [
            warning(
                PORTS, f"{port.purpose}: {port.protocol} port {port.number} is not open", "see fleet logs"
            )
            for port in missing
        ] or [ok(PORTS, f"{len(wanted)} of {len(wanted)} ports are open, and the edge runs")]
    return [
        error(
            PORTS,
            f"{port.purpose}: another program has {port.protocol} port {port.number}",
            f"stop it (ss -lnp 'sport = :{port.number}' names it), or take another port in fleet.yaml",
        )
        for port in used
    ] or [ok(PORTS, f"{len(wanted)} of {len(wanted)} ports are free")]


def check_broker(cloud: CloudConfig, now: datetime) -> Finding:
    """Check the connection to the cloud's broker: name, connection, certificate and its expiry. Blocks."""
    place = f"{cloud.host}:{cloud.port}"
    try:
        with socket.create_connection((cloud.host, cloud.port), WITHIN) as opened:
            if not cloud.tls:
                return ok(BROKER, f"{place} is reached, without encryption")
            return _check_certificate(opened, cloud, place, now)
    except socket.gaierror as problem:
        return error(
            BROKER, f"{cloud.host} has no address: {problem.strerror}", "check cloud.host and the DNS server"
        )
    except ssl.SSLCertVerificationError as problem:
        return error(
            BROKER,
            f"{place}: its certificate is not trusted: {problem.verify_message}",
            "check this computer's clock, cloud.host, and cloud.ca_file with the broker's authority",
        )
    except ssl.SSLError as problem:
        return error(BROKER, f"{place} speaks no TLS: {problem.reason}", "check cloud.port, usually 8883")
    except OSError as problem:
        words = problem.strerror or "no answer"
        return error(
            BROKER, f"{place} is not reached: {words}", "check network, firewall, cloud.host and cloud.port"
        )


def _check_certificate(opened: socket.socket, cloud: CloudConfig, place: str, now: datetime) -> Finding:
    """Check the broker's certificate; raises ssl.SSLError and OSError."""
    context = ssl.create_default_context(cafile=str(cloud.ca_file) if cloud.ca_file else None)
    with context.wrap_socket(opened, server_hostname=cloud.host) as secured:
        shown = secured.getpeercert() or {}
    until = shown.get("notAfter")
    if not isinstance(until, str):
        return unknown(BROKER, f"{place} is reached; its certificate does not say when it ends")
    end = datetime.fromtimestamp(ssl.cert_time_to_seconds(until), UTC)
    if soon := ending(end, now):
        return warning(
            BROKER, f"{place} is reached; its certificate {soon}", "inform the operator of the broker"
        )
    return ok(BROKER, f"{place} is reached and trusted until {end:%Y-%m-%d}")


def check_endpoints(endpoints: Iterable[str]) -> list[Finding]:
    """Check that the endpoints of bus.connect accept connections; UDP cannot be checked. Blocks."""
    return [_check_endpoint(end) for end in endpoints]


def _check_endpoint(end: str) -> Finding:
    """Check one endpoint."""
    match = _ENDPOINT.fullmatch(end)
    if match is None or _OF_PROTOCOL[match[1]] != "tcp":
        return unknown(ENDPOINTS, f"{end}: whether something listens is seen by the edge alone")
    try:
        with socket.create_connection((match[2].strip("[]"), int(match[3])), WITHIN):
            return ok(ENDPOINTS, f"{end} takes connections")
    except OSError as problem:
        words = problem.strerror or "no answer"
        return error(
            ENDPOINTS,
            f"{end} is not reached: {words}",
            "start the edge or router there; check bus.listen and firewalls",
        )
