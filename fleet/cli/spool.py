"""``fleet spool``: the messages for the cloud that wait on this edge's disk."""

from __future__ import annotations

import base64
import time
from pathlib import Path

import click
import msgspec

from fleet.cli.interrupt import end_on_interrupt, restore_interrupt
from fleet.cli.output import Output, counted, with_output
from fleet.config.load import sections_of
from fleet.spool import inspection
from fleet.spool.state_folder import state_folder

file_option = click.option(
    "-f", "--file", default="fleet.yaml", show_default=True, type=click.Path(), help="The edge's fleet file."
)


@click.group()
def spool() -> None:
    """Show or delete the messages that are queued for the cloud on disk.

    Replies, status and events that the cloud has not acknowledged yet are kept on disk.
    """


@spool.command()
@file_option
@with_output
def status(out: Output, file: str) -> None:
    """Show the queued messages by topic, and the lost ones.

    Works while the edge runs. The newest messages may still be only in its memory.
    """
    folder = _folder(file)
    rows, gaps, used = (
        inspection.backlog(folder),
        inspection.unreported_losses(folder),
        inspection.in_use(folder),
    )
    now = time.time()
    out.data(
        {
            "folder": str(folder),
            "in_use": used,
            "messages": sum(row.messages for row in rows),
            "bytes": sum(row.bytes for row in rows),
            "topics": msgspec.to_builtins(rows),
            "lost": msgspec.to_builtins(gaps),
        }
    )
    if rows:
        out.table(
            ("class", "messages", "bytes", "first expires in", "topic"),
            [
                (row.traffic, str(row.messages), str(row.bytes), _in(row.expires - now), row.topic)
                for row in rows
            ],
        )
    for gap in gaps:
        out.say(f"lost: {counted(gap.lost, 'message')} on {gap.topic} ({gap.reason}), not reported yet")
    owner = "an edge uses it" if used else "no edge uses it"
    out.say(f"{folder}: {counted(sum(row.messages for row in rows), 'message')}; {owner}")


@spool.command()
@file_option
@with_output
def export(out: Output, file: str) -> None:
    """Print the queued messages, oldest first; nothing is removed.

    One line per message: expiry, topic, payload. With --json, a payload that is no text is in base64.
    """
    kept = list(inspection.messages(_folder(file)))
    out.data([_for_programs(message) for message in kept])
    for message in kept:
        text = message.payload.decode(errors="backslashreplace")
        out.say(f"{time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime(message.expires))} {message.topic} {text}")


def _confirmed(ctx: click.Context, _: click.Parameter, value: bool) -> None:  # noqa: FBT001 - click's signature
    """Ask for confirmation; during the question Ctrl-C ends the process by the signal's default action.

    Python's own handler only sets a flag: a signal just before the blocking read of the answer would have no
    effect until the next key.
    """
    ends = end_on_interrupt()
    try:
        if not value and not click.confirm("Delete all that waits for the cloud?"):
            ctx.abort()
    finally:
        if ends:
            restore_interrupt()


@spool.command()
@file_option
@click.option("--yes", is_flag=True, callback=_confirmed, expose_value=False, help="Do not ask.")
@with_output
def purge(out: Output, file: str) -> None:
    """Delete all queued messages; they will never reach the cloud.

    The edge must not run.
    """
    deleted = inspection.purge(_folder(file))
    out.data({"deleted": deleted})
    out.say(f"deleted {counted(deleted, 'message')}")


def _folder(file: str) -> Path:
    """Return the state folder of a fleet file's edge."""
    edge = sections_of(file).edge
    return state_folder(edge.id, edge.spool.path).resolve()


def _in(seconds: float) -> str:
    """Return a time in a suitable unit."""
    if seconds <= 0:
        return "now"
    size, unit = next(
        (size, unit) for size, unit in ((3600, "h"), (60, "min"), (1, "s")) if seconds >= size or size == 1
    )
    return f"{seconds / size:.0f} {unit}"


def _for_programs(message: inspection.QueuedMessage) -> dict[str, object]:
    """Return a message for programs."""
    fields = {name: getattr(message, name) for name in ("seq", "topic", "traffic", "expires")}
    try:
        return {**fields, "payload": message.payload.decode()}
    except UnicodeDecodeError:
        return {**fields, "payload_base64": base64.b64encode(message.payload).decode()}
