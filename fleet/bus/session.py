"""The bus of one process: the reports' lane and the control lane."""

from __future__ import annotations

import logging
from pathlib import Path

from fleet.bus.lane import Lane
from fleet.bus.settings import (
    LOOPBACK_PORT,
    BusSettings,
    loopback_is_free,
    running_edges,
    socket_path,
    zenoh_settings,
)
from fleet.errors import BusError

log = logging.getLogger(__name__)


class Bus:
    """Two lanes that share nothing but the process."""

    def __init__(self, reports: Lane, control: Lane) -> None:
        self.reports = reports
        self.control = control

    def close(self) -> None:
        """Leave the bus."""
        self.control.close()
        self.reports.close()


def open_edge(settings: BusSettings, directory: Path) -> Bus:
    """Open the bus of an edge, listening; raises BusError (an edge of this id runs already, port taken)."""
    reports_socket = socket_path(settings.edge, "reports", directory)
    control_socket = socket_path(settings.edge, "control", directory)
    _take_sockets(settings.edge, directory, control_socket)
    mode = settings.mode
    remote = settings.connect
    given = settings.listen
    if given is None:
        given = (f"tcp/127.0.0.1:{LOOPBACK_PORT}",) if mode != "client" and loopback_is_free() else ()
        if not given and mode != "client":
            log.warning("port %d is taken: the bus is on its Unix socket only", LOOPBACK_PORT)
    # A client cannot listen, so an edge that joins a router opens peers that connect to it.
    reports = Lane(
        zenoh_settings(
            settings,
            mode="router" if mode == "router" else "peer",
            listen=(reports_socket, *given),
            connect=remote,
        )
    )
    try:
        control = Lane(
            zenoh_settings(
                settings,
                mode="peer",
                listen=(control_socket, *(_any_port(endpoint) for endpoint in given)),
                connect=(reports_socket, *remote),
            )
        )
    except BusError:
        reports.close()
        raise
    return Bus(reports, control)


def join(settings: BusSettings, directory: Path) -> Bus:
    """Join an edge's bus from another process of this machine, or over ``connect`` from anywhere."""
    if settings.connect:
        endpoints = (settings.connect, settings.connect)
    else:
        endpoints = (
            (socket_path(settings.edge, "reports", directory),),
            (socket_path(settings.edge, "control", directory),),
        )
    reports = Lane(zenoh_settings(settings, mode="client", listen=(), connect=endpoints[0]))
    try:
        control = Lane(zenoh_settings(settings, mode="client", listen=(), connect=endpoints[1]))
    except BusError:
        reports.close()
        raise
    return Bus(reports, control)


def join_control(settings: BusSettings, directory: Path) -> Lane:
    """Join only the control lane (the command line does); raises BusError when no edge answers."""
    endpoints = settings.connect or (socket_path(settings.edge, "control", directory),)
    return Lane(zenoh_settings(settings, mode="client", listen=(), connect=endpoints))


def _take_sockets(edge: str, directory: Path, control_socket: str) -> None:
    """Clear away the sockets of an edge that died; refuse when it is alive."""
    if edge not in running_edges(directory):
        return
    probe = zenoh_settings(BusSettings(edge), mode="client", listen=(), connect=(control_socket,))
    try:
        Lane(probe).close()
    except BusError:
        for path in directory.glob(f"{edge}.*.sock*"):
            path.unlink(missing_ok=True)
        return
    raise BusError(f"edge {edge!r} is running already on this machine; stop it, or change edge.id")


def _any_port(endpoint: str) -> str:
    """Return the endpoint with a port of the system's choice (gossip tells it to who asks)."""
    head, _, _ = endpoint.rpartition(":")
    return f"{head}:0"
