"""Start parameters of the body controller process."""

from __future__ import annotations

import msgspec


class ControlTask(msgspec.Struct, frozen=True):
    """Description file, buses by name (URLs) or simulated world, and descriptors of the shared memory.

    ``relay``: descriptor for frames to a recorder. ``captures``: folder for the frames before faults.
    """

    body: str
    buses: dict[str, str]
    sim: str
    faults: dict[str, float]
    order: int
    state: int
    captures: str
    relay: int


class StatusMessage(msgspec.Struct, frozen=True, omit_defaults=True):
    """Message of the process on standard output, one line each: ready, or the reason of its end."""

    ready: bool = False
    lost: str = ""
    refused: str = ""
