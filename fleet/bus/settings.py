"""Settings of the bus, and the Zenoh configuration made from them.

An edge has two sessions: one for reports, one for commands, stop and liveliness, each with links of its
own, so that a slow reader of reports cannot delay a stop. They listen on Unix sockets in a private directory
of the user, where local programs join (the SDK's DataBus too), and nowhere else unless fleet.yaml says so:
any user of the computer can connect to a loopback port.
"""

from __future__ import annotations

import errno
import os
import socket
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import msgspec

from fleet.bus.access import Access, access_control
from fleet.errors import BusError

SOCKET = "unixsock-stream"  # Zenoh's word for a Unix socket
LEASE_MS = 1000  # time after which a frozen process is noticed
LONGEST_SOCKET_PATH = 100  # the kernel takes 107 bytes


class BusTls(msgspec.Struct, frozen=True):
    """Certificates for ``tls/`` endpoints; with ``mutual`` both sides must show one."""

    root_ca: str | None = None
    certificate: str | None = None
    key: str | None = None
    mutual: bool = False
    verify_name: bool = True


class BusSettings(msgspec.Struct, frozen=True):
    """Bus settings of fleet.yaml; ``listen`` are the endpoints to open besides the Unix sockets.

    Without ``access`` every peer that can connect may do everything.
    """

    edge: str
    mode: Literal["peer", "client", "router"] = "peer"
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    tls: BusTls = BusTls()
    user: str | None = None
    password: str | None = None
    scouting: bool = False
    access: Access | None = None


MEMORY = Path("/dev/shm")  # noqa: S108 - the owner of the directory is checked
"""In-memory file system of Linux, for the execution journal, which must not wait for a disk."""


SERVICE_RUNTIME = Path("/run/fleet")
"""Runtime directory of edges that systemd runs; its group may join them (``fleet service``)."""


def runtime_dir(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the directory of the edges' sockets, private to this user: access to them allows commands.

    It is FLEET_RUNTIME_DIR, or a folder in XDG_RUNTIME_DIR, or one in memory if the system has that, or a
    temporary one.
    """
    path = _runtime_path(environ)
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
        if found.st_uid != os.getuid() or not stat.S_ISDIR(found.st_mode):
            raise BusError(f"{path} is not a directory of this user; set FLEET_RUNTIME_DIR to one that is")
        path.chmod(0o750 if path == SERVICE_RUNTIME else 0o700)
    except OSError as error:
        raise BusError(f"cannot create {path} for the bus's sockets: {error.strerror}") from None
    return path


def fallback_dirs(environ: Mapping[str, str] = os.environ) -> list[Path]:
    """Return further directories in which ``fleet stop`` looks for sockets; none if FLEET_RUNTIME_DIR is set.

    They need not exist. A runtime directory can be removed while an edge runs.
    """
    if environ.get("FLEET_RUNTIME_DIR"):
        return []
    return [place / f"fleet-{os.getuid()}" for place in _shared_places()]


def client_dirs(environ: Mapping[str, str] = os.environ) -> list[Path]:
    """Return the directories in which a program of this user finds edges: its own, and that of services.

    Only FLEET_RUNTIME_DIR if it is set. Raises BusError like ``runtime_dir``.
    """
    own = runtime_dir(environ)
    return (
        [own]
        if environ.get("FLEET_RUNTIME_DIR") or not _is_shared(SERVICE_RUNTIME)
        else [own, SERVICE_RUNTIME]
    )


def _is_shared(path: Path) -> bool:
    """Return True when this user can find the edges of services there; systemd created the directory."""
    return path.is_dir() and os.access(path, os.R_OK | os.X_OK)


def runtime_dirs(environ: Mapping[str, str] = os.environ) -> list[Path]:
    """Return the existing directories that may hold sockets of edges which this user can stop.

    Only FLEET_RUNTIME_DIR if it is set. Otherwise all directories of this user, whatever the environment of
    the edge, and that of services for their group; for root, those of all users.
    """
    if given := environ.get("FLEET_RUNTIME_DIR"):
        return [Path(given)]
    user = os.getuid()
    whose = "*" if user == 0 else str(user)
    found = [_runtime_path(environ), *Path("/run/user").glob(f"{whose}/fleet")]
    for place in _shared_places():
        found += place.glob(f"fleet-{whose}")
    ours = [path for path in dict.fromkeys(found) if _is_ours(path, user)]
    return [
        *ours,
        *([SERVICE_RUNTIME] if SERVICE_RUNTIME not in ours and _is_shared(SERVICE_RUNTIME) else []),
    ]


def _is_ours(path: Path, user: int) -> bool:
    """Return True for a directory of this user, and for root for any directory."""
    try:
        found = path.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and user in (0, found.st_uid)


def _runtime_path(environ: Mapping[str, str]) -> Path:
    """Return the path of the runtime directory for an environment."""
    if given := environ.get("FLEET_RUNTIME_DIR"):
        return Path(given)
    if given := environ.get("XDG_RUNTIME_DIR"):
        return Path(given) / "fleet"
    return _shared_places()[0] / f"fleet-{os.getuid()}"


def _shared_places() -> list[Path]:
    """Return the folders of all users in which each has a directory: in memory if possible, or temporary."""
    return [place for place in (MEMORY, Path(tempfile.gettempdir())) if place.is_dir()]


def socket_path(edge: str, bus_session: str, directory: Path) -> str:
    """Return the Unix socket endpoint of one session of an edge."""
    path = directory / f"{edge}.{bus_session}.sock"
    if len(str(path).encode()) > LONGEST_SOCKET_PATH:
        raise BusError(f"{path} is too long for a Unix socket; set FLEET_RUNTIME_DIR to a shorter place")
    return f"{SOCKET}/{path}"


def running_edges(directory: Path) -> list[str]:
    """Return the ids of the edges that run here, including frozen ones; never raises for a bad name."""
    names = (path.name.removesuffix(".control.sock") for path in directory.glob("*.control.sock"))
    return sorted(name for name in names if _fits(name, directory) and is_running(name, directory))


def _fits(edge: str, directory: Path) -> bool:
    """Return False for a path that is too long for a Unix socket."""
    try:
        socket_path(edge, "control", directory)
    except BusError:
        return False
    return True


def is_running(edge: str, directory: Path) -> bool:
    """Return True when a process holds the edge's control socket, even a busy or frozen one."""
    address = socket_path(edge, "control", directory).partition("/")[2]
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        # A full accept queue (EAGAIN) belongs to a live process; the socket of a dead one refuses.
        return probe.connect_ex(address) in (0, errno.EAGAIN)


def users_file(settings: BusSettings, directory: Path) -> Path | None:
    """Write Zenoh's file of users and passwords, readable only by this user; None when no user is set."""
    if settings.user is None:
        return None
    password = settings.password or ""
    if ":" in settings.user or not all(map(_is_plain, (settings.user, password))):
        raise BusError(
            "bus user and password: neither may be empty, begin or end with a blank, or hold a line break, "
            "nor the user a colon"
        )
    with tempfile.NamedTemporaryFile("w", dir=directory, prefix="users.", delete=False) as file:
        file.write(f"{settings.user}:{password}\n")
    return Path(file.name)


def _is_plain(text: str) -> bool:
    """Return True for text that can be one field of one line."""
    return text != "" and text == text.strip() and len(text.splitlines()) == 1


def zenoh_settings(
    settings: BusSettings,
    *,
    mode: str,
    listen: tuple[str, ...],
    connect: tuple[str, ...],
    users: Path | None = None,
) -> dict[str, object]:
    """Return Zenoh's configuration, by path, for one session; ``users``: the file of ``users_file``."""
    values: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2},
        "scouting/multicast/enabled": settings.scouting,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/protocols": _protocols(settings),
    }
    if mode == "client":
        # A client must not wait long for an edge that is frozen.
        values["transport/unicast/open_timeout"] = LEASE_MS
    else:
        # An edge opens immediately, and keeps trying to reach the others.
        values["connect/timeout_ms"] = -1
        values["connect/exit_on_failure"] = False
        values["open/return_conditions/connect_scouted"] = False
        if settings.access is not None:
            values["access_control"] = access_control(settings.access, settings.edge, _protocols(settings))
    values |= _tls(settings.tls)
    if settings.user is not None:
        values["transport/auth/usrpwd/user"] = settings.user
        values["transport/auth/usrpwd/password"] = settings.password or ""
    if users is not None:
        values["transport/auth/usrpwd/dictionary_file"] = str(users)
    return values


def _protocols(settings: BusSettings) -> list[str]:
    """Return the protocols that the session may use at all, also for peers that it learns of by gossip.

    A program that joins announces the peers that it knows, and Zenoh connects to them. So a program that also
    listens on the network would connect us to unknown peers.
    """
    spoken = {end.partition("/")[0] for end in (*settings.listen, *settings.connect)} | {SOCKET}
    if settings.scouting and spoken == {SOCKET}:
        spoken.add("tls" if settings.tls.root_ca else "tcp")
    return sorted(spoken)


def _tls(tls: BusTls) -> dict[str, object]:
    """Return the TLS part of the configuration."""
    root = "transport/link/tls"
    values: dict[str, object] = {
        f"{root}/enable_mtls": tls.mutual,
        f"{root}/verify_name_on_connect": tls.verify_name,
    }
    if tls.root_ca:
        values[f"{root}/root_ca_certificate"] = tls.root_ca
    if tls.certificate and tls.key:
        for side in ("listen", "connect"):
            values[f"{root}/{side}_certificate"] = tls.certificate
            values[f"{root}/{side}_private_key"] = tls.key
    return values
