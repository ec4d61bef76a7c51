"""Security of the bus endpoints: each is judged by itself, whatever others there are.

Pure functions on Zenoh's locators (``protocol/address?metadata#options``).
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from typing import Literal, NamedTuple

from fleet.model.permission import Permission

Insecure = Literal["local"] | bool
"""Access without proof of identity permitted in fleet.yaml: none, from this computer, from anywhere."""

Role = Literal["edge", "worker", "console", "program", "router", "view", "operate", "admin"]
"""Roles of identities on the bus; the role of a person is the person's permission."""

PERSONS: Mapping[str, Permission] = {each.word: each for each in Permission}
"""Permissions by the roles of persons."""

PERSON = "person"
"""Role in the certificates of persons; each edge configures their permissions."""

COMMON_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""Valid names of identities: they fit the common name of a certificate and a file name."""

LONGEST_SOCKET_PATH = 107
"""Linux's limit of a Unix socket's path, bytes."""
LONGEST_LISTENING_PATH = LONGEST_SOCKET_PATH - len(".control")
"""Limit for a listening socket, bytes: the second session appends ``.control`` to the path."""

_LOCATOR = re.compile(r"(tcp|udp|tls|quic|ws|unixsock-stream|unixpipe|serial|vsock)/\S+")
_OF_ITS_OWNER = frozenset({"unixsock-stream", "serial"})  # protected by file permissions
_ON_THIS_COMPUTER = frozenset({"unixpipe", "vsock"})  # Zenoh creates its pipes open to all users
_ENCRYPTED = frozenset({"tls", "quic"})
_UNDERMINES = re.compile(
    r"\b(enable_mtls|verify_name_on_connect|root_ca_certificate\w*|\w+_(private_key|certificate)\w*)="
)


class Proof(NamedTuple):
    """Required proof of peers: a password, a certificate (``mutual``), or neither."""

    password: bool
    certificates: bool
    mutual: bool


def check_locator(text: str) -> str:
    """Return a valid endpoint unchanged; raises ValueError for one that is unusable or bypasses ``tls``."""
    if not _LOCATOR.fullmatch(text):
        raise ValueError("must be an endpoint like tcp/192.168.1.10:7447 or unixsock-stream//run/fleet.sock")
    if is_encrypted(text) and (found := _UNDERMINES.search(text.partition("#")[2])):
        raise ValueError(f"{found[1]} cannot be set for one endpoint; say it in tls:, for all of them")
    if too_long := socket_too_long(text, LONGEST_SOCKET_PATH):
        raise ValueError(too_long)
    return text


def socket_too_long(endpoint: str, longest: int) -> str:
    """Return the error of a Unix socket whose path is too long; empty for other endpoints."""
    kind, _, address = re.split("[?#]", endpoint)[0].partition("/")
    size = len(address.encode())
    if kind != "unixsock-stream" or size <= longest:
        return ""
    return (
        f"the path has {size} bytes, and that of a Unix socket may have {longest} here; choose a shorter one"
    )


def is_local(host: str) -> bool:
    """Return True if a host name or address is this computer."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def is_encrypted(endpoint: str) -> bool:
    """Return True for an endpoint whose listener presents a certificate."""
    return endpoint.partition("/")[0] in _ENCRYPTED


def listening_danger(endpoint: str, proof: Proof, insecure: Insecure) -> str:
    """Return who could command the robots over a listening endpoint; empty if no stranger could."""
    if proof.password or (is_encrypted(endpoint) and proof.mutual):
        return ""
    return _danger(endpoint, insecure, "could command the robots over it")


def connecting_danger(endpoint: str, proof: Proof, insecure: Insecure) -> str:
    """Return who could impersonate a peer that we connect to, and command the robots; empty if none."""
    if proof.password or is_encrypted(endpoint):
        return ""
    return _danger(endpoint, insecure, "could answer there instead, and command the robots")


def scouting_danger(endpoints: tuple[str, ...], proof: Proof, insecure: Insecure) -> str:
    """Return the danger of joining peers found by multicast; empty if there is none.

    Announced peers are dialled, and present a certificate only if all endpoints are encrypted.
    """
    plain = [end for end in endpoints if not is_encrypted(end) and _reach(end) != "socket"]
    if insecure is True or (proof.certificates and not plain):
        return ""
    beside = f", and no {plain[0].partition('/')[0]}/ endpoint," if plain and proof.certificates else ""
    return (
        "anyone on the network could announce itself, be joined, and command the robots; "
        f"set tls:{beside} or insecure: true"
    )


def folder_of(endpoint: str) -> str:
    """Return the folder of a Unix socket, empty for other endpoints."""
    kind, _, address = re.split("[?#]", endpoint)[0].partition("/")
    return address.rpartition("/")[0] or "/" if kind == "unixsock-stream" else ""


def shared_folder_danger(endpoint: str, proof: Proof, insecure: Insecure) -> str:
    """Return who could replace a Unix socket in a folder that all users can write to."""
    if proof.password or insecure is not False:
        return ""
    return (
        f"every user of this computer may write to {folder_of(endpoint)} and put another socket there, and "
        "command the robots; choose a folder of your own, or set insecure: local"
    )


def is_unencrypted(endpoint: str) -> bool:
    """Return True if the traffic of an endpoint can be read and changed on the network."""
    return not is_encrypted(endpoint) and _reach(endpoint) == "network"


def _danger(endpoint: str, insecure: Insecure, could: str) -> str:
    """Return who could do ``could`` over an endpoint that requires no proof."""
    reach = _reach(endpoint)
    if reach == "socket" or insecure is True or (reach == "computer" and insecure == "local"):
        return ""
    if reach == "computer":
        return f"every user of this computer {could}; set user: and password:, or insecure: local"
    certificates = "tls: with mutual: true" if is_encrypted(endpoint) else "a tls/ endpoint with tls:"
    return f"anyone on the network {could}; set {certificates}, or user: and password:, or insecure: true"


def _reach(endpoint: str) -> Literal["socket", "computer", "network"]:
    """Return who reaches an endpoint: its owner, all users of the computer, or the network."""
    kind, _, address = endpoint.partition("/")
    if kind in _OF_ITS_OWNER:
        return "socket"
    if kind in _ON_THIS_COMPUTER:
        return "computer"
    host = re.split("[?#]", address)[0].rpartition(":")[0]
    return "computer" if is_local(host) else "network"
