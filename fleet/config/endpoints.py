"""Who could come in by an endpoint of the bus: each is judged by itself, whatever stands beside it.

Pure functions over Zenoh's locators (``protocol/address?metadata#options``).
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from typing import Literal, NamedTuple

from fleet.model.permission import Permission

Insecure = Literal["local"] | bool
"""What fleet.yaml allows without proof: nothing, all of this computer, everything."""

Role = Literal["edge", "worker", "console", "program", "router", "view", "operate", "admin"]
"""What an identity on the bus is there for; of a person, what that person may do."""

PERSONS: Mapping[str, Permission] = {each.word: each for each in Permission}
"""The roles of persons."""

PERSON = "person"
"""What the certificate of a person is for; what the person may do is said by each edge."""

COMMON_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""What an identity may be called: what fits the common name of a certificate, and a file's name."""

LONGEST_SOCKET_PATH = 107
"""Bytes of a Unix socket's path that the kernel takes."""
LONGEST_LISTENING_PATH = LONGEST_SOCKET_PATH - len(".control")
"""Bytes of the path of a socket that listens: the second session's is ``.control`` behind it."""

_LOCATOR = re.compile(r"(tcp|udp|tls|quic|ws|unixsock-stream|unixpipe|serial|vsock)/\S+")
_OF_ITS_OWNER = frozenset({"unixsock-stream", "serial"})  # who may, say the rights of a file
_ON_THIS_COMPUTER = frozenset({"unixpipe", "vsock"})  # Zenoh makes its pipes open to all users
_ENCRYPTED = frozenset({"tls", "quic"})
_UNDERMINES = re.compile(
    r"\b(enable_mtls|verify_name_on_connect|root_ca_certificate\w*|\w+_(private_key|certificate)\w*)="
)


class Proof(NamedTuple):
    """What is asked of who comes in: a password, a certificate (``mutual``), or neither."""

    password: bool
    certificates: bool
    mutual: bool


def check_locator(text: str) -> str:
    """Return an endpoint as it is; raises ValueError for one that is unusable, or undoes ``tls``."""
    if not _LOCATOR.fullmatch(text):
        raise ValueError("must be an endpoint like tcp/192.168.1.10:7447 or unixsock-stream//run/fleet.sock")
    if is_encrypted(text) and (found := _UNDERMINES.search(text.partition("#")[2])):
        raise ValueError(f"{found[1]} cannot be set for one endpoint; say it in tls:, for all of them")
    if too_long := socket_too_long(text, LONGEST_SOCKET_PATH):
        raise ValueError(too_long)
    return text


def socket_too_long(endpoint: str, longest: int) -> str:
    """Return what is wrong with a Unix socket whose path has more bytes than it may; empty for others."""
    kind, _, address = re.split("[?#]", endpoint)[0].partition("/")
    size = len(address.encode())
    if kind != "unixsock-stream" or size <= longest:
        return ""
    return (
        f"the path has {size} bytes, and that of a Unix socket may have {longest} here; choose a shorter one"
    )


def is_local(host: str) -> bool:
    """Return True when a host name or address is this computer itself."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def is_encrypted(endpoint: str) -> bool:
    """Return True for an endpoint whose listener shows a certificate."""
    return endpoint.partition("/")[0] in _ENCRYPTED


def listening_danger(endpoint: str, proof: Proof, insecure: Insecure) -> str:
    """Return who could command the robots over an endpoint that listens; empty when nobody unknown could."""
    if proof.password or (is_encrypted(endpoint) and proof.mutual):
        return ""
    return _danger(endpoint, insecure, "could command the robots over it")


def connecting_danger(endpoint: str, proof: Proof, insecure: Insecure) -> str:
    """Return who could take the place of whom we connect to, and command the robots; empty for nobody."""
    if proof.password or is_encrypted(endpoint):
        return ""
    return _danger(endpoint, insecure, "could answer there instead, and command the robots")


def scouting_danger(endpoints: tuple[str, ...], proof: Proof, insecure: Insecure) -> str:
    """Return what is wrong with joining whoever announces itself on the network; empty when nothing is.

    Who announces is dialled, and shows a certificate only where nothing but encrypted endpoints is spoken.
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
    """Return who could take the place of a Unix socket in a folder that all users may write to."""
    if proof.password or insecure is not False:
        return ""
    return (
        f"every user of this computer may write to {folder_of(endpoint)} and put another socket there, and "
        "command the robots; choose a folder of your own, or set insecure: local"
    )


def carried_in_the_open(endpoint: str) -> bool:
    """Return True when what is said over an endpoint can be read and changed on the network."""
    return not is_encrypted(endpoint) and _reach(endpoint) == "network"


def _danger(endpoint: str, insecure: Insecure, could: str) -> str:
    """Return who could do what by an endpoint that asks for no proof."""
    reach = _reach(endpoint)
    if reach == "socket" or insecure is True or (reach == "computer" and insecure == "local"):
        return ""
    if reach == "computer":
        return f"every user of this computer {could}; set user: and password:, or insecure: local"
    certificates = "tls: with mutual: true" if is_encrypted(endpoint) else "a tls/ endpoint with tls:"
    return f"anyone on the network {could}; set {certificates}, or user: and password:, or insecure: true"


def _reach(endpoint: str) -> Literal["socket", "computer", "network"]:
    """Return from where an endpoint can be reached: by its owner, by all users of a computer, by others."""
    kind, _, address = endpoint.partition("/")
    if kind in _OF_ITS_OWNER:
        return "socket"
    if kind in _ON_THIS_COMPUTER:
        return "computer"
    host = re.split("[?#]", address)[0].rpartition(":")[0]
    return "computer" if is_local(host) else "network"
