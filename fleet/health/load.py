"""How busy the host is, read from /proc; everything is None where that is not to be had."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import msgspec

MEMINFO = Path("/proc/meminfo")
THERMAL = Path("/sys/class/thermal/thermal_zone0/temp")


class HostLoad(msgspec.Struct, frozen=True):
    """The computer and this process: load per core (1 min), percent, MiB, degrees Celsius."""

    load: float | None = None
    memory_percent: float | None = None
    memory_available_mb: float | None = None
    cpu_temperature: float | None = None
    threads: int = 0


def read_load() -> HostLoad:
    """Return the load now."""
    memory = _memory()
    return HostLoad(
        load=round(os.getloadavg()[0] / (os.cpu_count() or 1), 3),
        memory_percent=memory[0] if memory else None,
        memory_available_mb=memory[1] if memory else None,
        cpu_temperature=_temperature(),
        threads=threading.active_count(),
    )


def _memory() -> tuple[float, float] | None:
    """Return (percent in use, MiB available)."""
    try:
        lines = MEMINFO.read_text().splitlines()
    except OSError:
        return None
    values = {
        name: float(rest.split()[0])
        for name, _, rest in (line.partition(":") for line in lines)
        if rest.strip()
    }
    total, available = values.get("MemTotal"), values.get("MemAvailable")
    if not total or available is None:
        return None
    return round(100.0 * (1.0 - available / total), 1), round(available / 1024.0, 1)


def _temperature() -> float | None:
    """Return the processor's temperature."""
    try:
        return round(int(THERMAL.read_text()) / 1000.0, 1)
    except (OSError, ValueError):
        return None
