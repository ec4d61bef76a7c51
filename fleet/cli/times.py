"""Times on the command line: relative times, and dates with zone."""

from __future__ import annotations

import math
import re
import time
from datetime import UTC, datetime

import click

_AGO = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|m|h|d|w)")
_LENGTH = re.compile(r"(\d+(?:\.\d+)?) ?(s|min|h)")
_UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}


def since(_context: click.Context, _option: click.Parameter, text: str | None) -> float:
    """Return the Unix seconds of ``1h``, ``30m``, ``2d`` ago or an ISO date; 0 without a value."""
    if text is None:
        return 0.0
    found = _AGO.fullmatch(text.strip())
    if found:
        return time.time() - float(found[1]) * _UNITS[found[2]]
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        raise click.BadParameter(f"{text!r} is neither like 30m, 1h, 2d nor a date like 2026-11-22") from None


def length(_context: click.Context, _option: click.Parameter, text: str | None) -> float:
    """Return the seconds of ``30s``, ``10min`` or ``1h``; infinite without a value."""
    if text is None:
        return math.inf
    found = _LENGTH.fullmatch(text.strip())
    if found is None:
        raise click.BadParameter(f"{text!r} is no length of time: write 30s, 10min or 1h")
    return float(found[1]) * _UNITS[found[2]]


since_option = click.option(
    "--since", callback=since, help="How far back: 30m, 1h, 2d, or a date (local without a zone)."
)


def when(stamp: float) -> str:
    """Return Unix seconds as local date, time and zone; a dash for an invalid time."""
    try:
        return datetime.fromtimestamp(stamp, UTC).astimezone().isoformat(" ", "seconds")
    except (ValueError, OverflowError, OSError):
        return "-"


def iso(stamp: float) -> str:
    """Return Unix seconds for programs: ISO 8601, UTC, milliseconds; empty for an invalid time."""
    try:
        return datetime.fromtimestamp(stamp, UTC).isoformat(timespec="milliseconds")
    except (ValueError, OverflowError, OSError):
        return ""
