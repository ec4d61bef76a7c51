"""Checks of a pair: the place of its lease service, and robots without a standby."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterable, Sequence

from fleet.config.other_edges import LeaseConfig, host_of, port_of
from fleet.config.pair import is_local_link
from fleet.doctor.finding import Finding, error, ok, warning
from fleet.model.state import EdgeState

PAIR = "pair"
WITHIN = 3.0  # s for one connection
SCHEMES = ("serial:", "can:", "memory:", "sim:")


def runs_here(server: str) -> bool:
    """Return True if a server's name resolves to an address of this computer. Blocks."""
    try:
        found = socket.getaddrinfo(host_of(server), None, type=socket.SOCK_DGRAM)
    except OSError:
        return False
    return any(_is_ours(family, address[0]) for family, _, _, _, address in found)


def _is_ours(family: int, address: str | int) -> bool:
    """Return True if an address is one of this computer's: only those can be bound."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
        return True


def answers(server: str) -> bool:
    """Return True if a server's port accepts connections. Blocks."""
    try:
        with socket.create_connection((host_of(server).strip("[]"), port_of(server)), WITHIN):
            return True
    except OSError:
        return False


def check_pair(
    lease: LeaseConfig,
    links: Iterable[str],
    *,
    here: Callable[[str], bool] = runs_here,
    reached: Callable[[str], bool] = answers,
) -> list[Finding]:
    """Check the pair. A lease service that dies with one of its computers cannot hand over."""
    silent = [server for server in lease.servers if not reached(server)]
    found = _judge_place([server for server in lease.servers if here(server)], lease.servers)
    if silent:
        cure = "start it, or correct lease.servers; without it neither edge moves a robot"
        found.append(error(PAIR, f"nothing answers at {', '.join(silent)}", cure))
    alone = [link for link in links if link.startswith(SCHEMES) and is_local_link(link)]
    if alone:
        cure = "reach them over the network, or run them by an edge of their own"
        found.append(
            warning(PAIR, f"no standby for what only this computer reaches: {', '.join(alone)}", cure)
        )
    return found or [
        ok(PAIR, f"the lease service answers at {', '.join(lease.servers)}, on another computer")
    ]


def check_files(pair: Iterable[str], states: Iterable[EdgeState]) -> list[Finding]:
    """Check that the edges of a pair, as far as they answer, run with the same file."""
    files = {state.edge: state.pair_file for state in states if state.edge in pair and state.pair_file}
    if len(set(files.values())) < 2:
        return [ok(PAIR, "both edges of the pair run with the same file")] if len(files) > 1 else []
    what = f"{' and '.join(sorted(files))} run with different files: neither takes over from the other"
    return [error(PAIR, what, "give both the same file, then fleet apply on each")]


def _judge_place(here: Sequence[str], servers: Sequence[str]) -> list[Finding]:
    """Check that the service survives this computer: a cluster needs a majority of its servers."""
    if 2 * len(here) < len(servers) or not here:
        return []
    what = f"this is no standby: the lease service at {', '.join(here)} dies with this computer"
    return [error(PAIR, what, "run it on a third computer, or as a cluster on three")]
