"""Expiry of the certificates of the edge's bus and console, reported in its health in advance."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from fleet.clock import Clock
from fleet.config.schema import Sections

SOON = timedelta(days=30)
"""How long before its expiry a certificate is reported."""


def ending(until: datetime, now: datetime) -> str:
    """Return the text for a certificate that expires soon or has expired; empty for any other."""
    left = until - now
    if left > SOON:
        return ""
    day = f"{until:%Y-%m-%d}"
    return f"has expired on {day}" if left <= timedelta() else f"expires in {left.days} days, on {day}"


def files_of(config: Sections) -> dict[Path, str]:
    """Return the certificates of an edge's bus and console, each with its section of fleet.yaml."""
    bus, console = config.bus.tls, config.console.tls if config.console is not None else None
    found = {} if bus is None else dict.fromkeys((bus.root_ca, bus.cert), "bus.tls")
    return found if console is None else found | {console.cert: "console.tls"}


class CertificateExpiry:
    """Expiry of certificates as they were at the start: the edge and Zenoh read them only then."""

    def __init__(self, files: Iterable[Path], clock: Clock) -> None:
        self._clock = clock
        self._ends: dict[Path, datetime] = {}
        self._unreadable: list[str] = []
        for file in files:
            self._read(file)

    def _read(self, file: Path) -> None:
        """Record when a certificate expires."""
        from fleet.config.certificates import first_end  # noqa: PLC0415 - slow to import; few have any

        try:
            self._ends[file] = first_end(file.read_bytes())
        except (OSError, ValueError):
            self._unreadable.append(f"{file.name} is no certificate that can be read")

    @property
    def problems(self) -> list[str]:
        """Texts for all that have expired, expire within 30 days, or cannot be read."""
        now = datetime.fromtimestamp(self._clock.time(), UTC)
        endings = ((file, ending(end, now)) for file, end in self._ends.items())
        advice = "make a new one: fleet certs renew"
        return [
            *self._unreadable,
            *(f"certificate {file.name} {said}; {advice}" for file, said in endings if said),
        ]

    @property
    def first_end(self) -> str:
        """The certificate that expires first, and the day; empty when none can be read."""
        if not self._ends:
            return ""
        file, end = min(self._ends.items(), key=lambda each: each[1])
        return f"{file.name} is the first to end, on {end:%Y-%m-%d}"

    @property
    def problem(self) -> str:
        """All problems in one line; empty without any."""
        return "; ".join(self.problems)
