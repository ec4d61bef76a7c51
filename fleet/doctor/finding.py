"""What a check found: a verdict, the facts in words, and what to do."""

from __future__ import annotations

import enum
from collections.abc import Iterable

import msgspec


class Verdict(enum.Enum):
    """How good it is; ``UNKNOWN``: it cannot be seen from here."""

    OK = "ok"
    UNKNOWN = "unknown"
    WARNING = "warning"  # the edge runs, but a person should know
    ERROR = "error"  # the edge, a robot or the cloud will not work


_ORDER = list(Verdict)


class Finding(msgspec.Struct, frozen=True):
    """One line of the report. ``cure`` is empty when there is nothing to do."""

    check: str
    verdict: Verdict
    found: str
    cure: str = ""


def ok(check: str, found: str) -> Finding:
    """Return that all is well."""
    return Finding(check, Verdict.OK, found)


def unknown(check: str, found: str, cure: str = "") -> Finding:
    """Return that it could not be seen, and why."""
    return Finding(check, Verdict.UNKNOWN, found, cure)


def warning(check: str, found: str, cure: str) -> Finding:
    """Return something that a person should look at."""
    return Finding(check, Verdict.WARNING, found, cure)


def error(check: str, found: str, cure: str) -> Finding:
    """Return something that does not work."""
    return Finding(check, Verdict.ERROR, found, cure)


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings with the worst first, those of one verdict in their order."""
    return sorted(findings, key=lambda finding: -_ORDER.index(finding.verdict))
