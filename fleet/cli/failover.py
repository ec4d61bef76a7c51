"""``fleet failover``: hand the robots of a pair over to the other edge."""

from __future__ import annotations

import time

import click
import msgspec

from fleet.bus import keys
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.client.edges import Edges
from fleet.errors import NotRunning, Refused, TimedOut
from fleet.model.command import Reply
from fleet.model.state import EdgeState

HOLDER = "holder"
GIVEN_WITHIN = 15.0  # s for the robots to hold and the lease to be released
POLL_INTERVAL = 0.2  # s between polls


class HandOver(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request to release the lease; ``accept``: a standby takes over although its file differs."""

    accept: bool = False


@click.command()
@click.argument("edge", required=False)
@click.option(
    "--accept-file",
    is_flag=True,
    help="Have EDGE, a standby with a different file than its dead partner, take the robots over.",
)
@reach_option
@with_output
def failover(out: Output, edge: str | None, *, accept_file: bool, file: str | None) -> ExitCode:
    """Hand the robots of a pair over to its other edge.

    EDGE is the one that has them; it may be left out if only one edge here has. Its robots are held, their
    links closed, and the other edge takes over; missions that run on this edge end. If the other edge does
    not run, this one takes the robots again.
    """
    with Edges.reach(file) as edges:
        if accept_file:
            return _accepted(out, edges, edge)
        holder = _holder(edges.edges(), edge)
        reply = edges.request(keys.failover(holder), Reply, HandOver())
        if not reply.ok:
            raise Refused(reply.reason)
        end = time.monotonic() + GIVEN_WITHIN
        while _role(edges.edges(), holder) == HOLDER:
            if time.monotonic() > end:
                raise TimedOut(f"edge {holder} still has the lease after {GIVEN_WITHIN:g} s")
            time.sleep(POLL_INTERVAL)
    out.data({"ok": True, "edge": holder})
    out.say(f"edge {holder} has released its robots; the other edge of the pair takes over")
    return ExitCode.OK


def _accepted(out: Output, edges: Edges, edge: str | None) -> ExitCode:
    """Have a standby with a different file take over."""
    if edge is None:
        raise click.UsageError("--accept-file needs EDGE: the standby that is to take over")
    reply = edges.request(keys.failover(edge), Reply, HandOver(accept=True))
    if not reply.ok:
        raise Refused(reply.reason)
    out.data({"ok": True, "edge": edge})
    out.say(f"edge {edge} takes the robots over by its own file, as soon as the lease is free")
    return ExitCode.OK


def _holder(states: list[EdgeState], edge: str | None) -> str:
    """Return the selected edge; raises NotRunning or Refused."""
    paired = {state.edge: state.pair for state in states if state.pair}
    if edge is not None:
        if edge not in paired:
            raise NotRunning(f"no edge {edge} of a pair can be reached")
        return edge
    holders = [name for name, role in paired.items() if role == HOLDER]
    if len(holders) == 1:
        return holders[0]
    if holders:
        raise Refused(f"several edges have the robots of their pair; say which: {', '.join(holders)}")
    if paired:
        raise NotRunning(f"{', '.join(paired)} is standby: ask on the computer of the other edge")
    raise NotRunning("no edge of a pair can be reached")


def _role(states: list[EdgeState], edge: str) -> str:
    """Return the role of an edge in its pair."""
    return next((state.pair for state in states if state.edge == edge), "")
