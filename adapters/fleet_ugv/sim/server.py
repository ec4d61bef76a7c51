"""Simulated bases of one process, each on a pseudo-terminal."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from fleet.sim.server import SimServer
from fleet_ugv.profiles import PROFILES
from fleet_ugv.sim.port import STEP, SimPort
from fleet_ugv.sim.spec import BaseSpec, board_of


class Bases(SimServer[BaseSpec, SimPort]):
    """The bases; their device files are in ``folder``."""

    Spec = BaseSpec
    tick: ClassVar[float] = STEP

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder
        self._count = 0

    async def make(self, spec: BaseSpec) -> SimPort:
        """Create a base; raises ValueError for an unknown one."""
        board = board_of(spec)
        self._count += 1
        return SimPort(board, self._folder / f"{spec.profile}-{self._count}", PROFILES[spec.profile].baud)
