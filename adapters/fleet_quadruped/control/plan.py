"""What a body-controller process is started with."""

from __future__ import annotations

import msgspec


class ControlPlan(msgspec.Struct, frozen=True):
    """The dog, its buses by name (URLs) or its simulated world, and the shared memory's descriptors.

    ``relay`` is the descriptor by which frames go to a recorder. ``captures`` is the folder for what was on
    the buses before a fault.
    """

    body: str
    buses: dict[str, str]
    sim: str
    faults: dict[str, float]
    order: int
    state: int
    captures: str
    relay: int


class Word(msgspec.Struct, frozen=True, omit_defaults=True):
    """What the process says on its standard output, a line each: it is ready, or why it ends."""

    ready: bool = False
    lost: str = ""
    refused: str = ""
