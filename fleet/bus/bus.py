"""The bus of one process: one Zenoh session for reports, one for control."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from fleet.bus.access import Access
from fleet.bus.keys import LOCAL
from fleet.bus.settings import (
    BusSettings,
    is_running,
    socket_path,
    users_file,
    zenoh_settings,
)
from fleet.bus.zenoh_session import ZenohSession
from fleet.config.endpoints import PERSON, PERSONS, is_encrypted
from fleet.errors import BusError


class Bus:
    """The two sessions of a process; ``connect`` are the endpoints of other edges or routers to join.

    ``sockets`` are the files of an edge's own Unix sockets.
    ``consoles`` are the identities on the bus that are consoles, and ``people`` those of persons with their
    permissions, by the edge's access rules.
    """

    def __init__(
        self,
        reports: ZenohSession,
        control: ZenohSession,
        connect: tuple[str, ...] = (),
        access: Access | None = None,
        sockets: tuple[Path, ...] = (),
    ) -> None:
        self.reports = reports
        self.control = control
        roles = access.roles if access else {}
        self.consoles = frozenset(name for name, role in roles.items() if role == "console")
        self.people = {name: PERSONS[role] for name, role in roles.items() if role in PERSONS}
        self._connect = connect
        self._sockets = sockets

    @property
    def problem(self) -> str:
        """Why an endpoint in ``connect`` is not joined; empty when all are."""
        reached = {_stable_part(endpoint) for endpoint in self.reports.reached()} if self._connect else set()
        missing = [endpoint for endpoint in self._connect if _stable_part(endpoint) not in reached]
        return _join_error(missing) if missing else ""

    @property
    def removed(self) -> str:
        """Which of its sockets were removed, as text; empty when programs on this computer can join.

        logind removes the runtime directory of a user who logs out. Zenoh cannot make a socket again.
        """
        missing = [path for path in self._sockets if not path.exists()]
        if not missing:
            return ""
        return (
            f"{missing[0]} was removed, as at a logout (loginctl enable-linger prevents that): "
            "only fleet stop finds this edge until it is restarted"
        )

    def close(self) -> None:
        """Close both sessions."""
        self.control.close()
        self.reports.close()


def open_edge(settings: BusSettings, directory: Path) -> Bus:
    """Open the bus of an edge, listening; raises BusError (edge id already running, port in use)."""
    if is_running(settings.edge, directory):
        raise BusError(
            f"edge {settings.edge!r} runs already on this machine (fleet ps); stop it, or change edge.id"
        )
    users = users_file(settings, directory)
    try:
        return _listening(settings, directory, users)
    finally:
        if users is not None:
            users.unlink()


def _listening(settings: BusSettings, directory: Path, users: Path | None) -> Bus:
    """Open both sessions, listening on the sockets too; Zenoh removes the sockets of an edge that died."""
    reports_socket = socket_path(settings.edge, "reports", directory)
    control_socket = socket_path(settings.edge, "control", directory)
    # A client cannot listen, so an edge that joins a router opens peers that connect to it.
    reports = ZenohSession(
        zenoh_settings(
            settings,
            mode="router" if settings.mode == "router" else "peer",
            listen=(reports_socket, *settings.listen),
            connect=settings.connect,
            users=users,
        )
    )
    try:
        control = ZenohSession(
            zenoh_settings(
                settings,
                mode="peer",
                listen=(control_socket, *(_control_endpoint(endpoint) for endpoint in settings.listen)),
                connect=(reports_socket, *settings.connect),
                users=users,
            )
        )
    except BusError:
        reports.close()
        raise
    _keep_locks(directory)
    sockets = tuple(Path(endpoint.partition("/")[2]) for endpoint in (reports_socket, control_socket))
    return Bus(reports, control, settings.connect, settings.access, sockets)


def _keep_locks(directory: Path) -> None:
    """Make Zenoh's lock files non-inheritable: a child that outlives us would lock out the next edge."""
    for link in Path("/proc/self/fd").glob("*"):
        with contextlib.suppress(OSError):  # the descriptor was closed meanwhile
            if link.readlink().is_relative_to(directory) and link.readlink().suffix == ".lock":
                os.set_inheritable(int(link.name), False)


def join(settings: BusSettings, directory: Path) -> Bus:
    """Join an edge's bus from another process of this machine, or over ``connect`` from anywhere."""
    reports = _join(settings, "reports", directory)
    try:
        control = _join(settings, "control", directory)
    except BusError:
        reports.close()
        raise
    return Bus(reports, control, access=settings.access)


def join_control(settings: BusSettings, directory: Path) -> ZenohSession:
    """Join only the control session (as the command line does); raises BusError when no edge answers."""
    return _join(settings, "control", directory)


def _join(settings: BusSettings, bus_session: str, directory: Path) -> ZenohSession:
    """Join one session: by the socket of an edge on this machine, if any, because it needs no network."""
    here = is_running(settings.edge, directory)
    if not here and not settings.connect:
        raise BusError(f"edge {settings.edge!r} does not run here; start it, or set bus.connect to reach it")
    endpoints = (socket_path(settings.edge, bus_session, directory),) if here else settings.connect
    try:
        session = ZenohSession(zenoh_settings(settings, mode="client", listen=(), connect=endpoints))
    except BusError:
        raise BusError(_join_error(endpoints)) from None
    if not here:
        session.identity, session.person = _identity(settings)
    return session


def _identity(settings: BusSettings) -> tuple[str, str]:
    """Return the name by which others know us: the name in our certificate if every endpoint checks it.

    The second item is the same name if the certificate is that of a person, otherwise empty.
    """
    if not settings.tls.certificate or not all(map(is_encrypted, settings.connect)):
        return LOCAL, ""
    from fleet.config.certificates import read_identity  # noqa: PLC0415 - slow to import, rarely needed

    try:
        identity = read_identity(Path(settings.tls.certificate).read_bytes())
    except (OSError, ValueError):
        return LOCAL, ""
    return identity.name, identity.name if identity.role == PERSON else ""


def _join_error(endpoints: Iterable[str]) -> str:
    """Return the error text for endpoints that cannot be joined; Zenoh gives no reason."""
    where = ", ".join(endpoints)
    return (
        f"cannot join the bus at {where}: peer down or frozen, or its user, password or TLS settings differ"
    )


def _stable_part(endpoint: str) -> tuple[str, str]:
    """Return protocol and port, or path, of an endpoint: the parts that name resolution does not change."""
    protocol, _, rest = re.split("[?#]", endpoint)[0].partition("/")
    return protocol, rest.rpartition(":")[2]


def _control_endpoint(endpoint: str) -> str:
    """Return the endpoint of the control session that belongs to one of the reports session.

    It has a port chosen by the system (others learn it by gossip), or, without ports, another name.
    """
    found, places = re.subn(r":\d+(?=$|[?#])", ":0", endpoint)
    return found if places else f"{endpoint}.control"
