"""Result of a check: a verdict, the facts, and a remedy."""

from __future__ import annotations

import enum
from collections.abc import Iterable

import msgspec


class Rating(enum.Enum):
    """Severity; ``UNKNOWN``: it cannot be determined from here."""

    OK = "ok"
    UNKNOWN = "unknown"
    WARNING = "warning"  # the edge runs, but a person should know
    ERROR = "error"  # the edge, a robot or the cloud will not work


_ORDER = list(Rating)


class Finding(msgspec.Struct, frozen=True):
    """One line of the report. ``cure`` is empty if there is nothing to do."""

    check: str
    verdict: Rating
    found: str
    cure: str = ""


def ok(check: str, found: str) -> Finding:
    """Return a finding without trouble."""
    return Finding(check, Rating.OK, found)


def unknown(check: str, found: str, cure: str = "") -> Finding:
    """Return a finding that could not be determined, with the reason."""
    return Finding(check, Rating.UNKNOWN, found, cure)


def warning(check: str, found: str, cure: str) -> Finding:
    """Return a finding that needs a person's attention."""
    return Finding(check, Rating.WARNING, found, cure)


def error(check: str, found: str, cure: str) -> Finding:
    """Return a finding that prevents operation."""
    return Finding(check, Rating.ERROR, found, cure)


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Sort findings by severity, worst first; otherwise in their order."""
    return sorted(findings, key=lambda finding: -_ORDER.index(finding.verdict))
