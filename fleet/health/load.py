"""Load of the host, read from /proc and /sys; values are None if these do not exist."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import msgspec

MEMINFO = Path("/proc/meminfo")
THERMAL = Path("/sys/class/thermal/thermal_zone0/temp")


class HostLoad(msgspec.Struct, frozen=True):
    """Load of the computer per core (1 min), memory in percent and MiB, degrees Celsius, own threads."""

    load: float | None = None
    memory_percent: float | None = None
    memory_available_mb: float | None = None
    cpu_temperature: float | None = None
    threads: int = 0


def read_load() -> HostLoad:
    """Return the current load."""
    memory = _memory()
    return HostLoad(
        load=round(os.getloadavg()[0] / (os.cpu_count() or 1), 3),
        memory_percent=memory[0] if memory else None,
        memory_available_mb=memory[1] if memory else None,
        cpu_temperature=_temperature(),
        threads=threading.active_count(),
    )


def _memory() -> tuple[float, float] | None:
    """Return (percent in use, MiB available), None when unknown."""
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
    """Return the processor's temperature in degrees Celsius, None when unknown."""
    try:
        return round(int(THERMAL.read_text()) / 1000.0, 1)
    except (OSError, ValueError):
        return None
