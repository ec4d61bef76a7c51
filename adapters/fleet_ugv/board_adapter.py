"""Shared base of the wheeled adapter's parts: the board on its open line."""

from __future__ import annotations

from fleet import Adapter
from fleet_ugv.board import Board
from fleet_ugv.config import UgvConfig


class BoardAdapter(Adapter[UgvConfig]):
    """An adapter whose ``connect`` opens the line of its board."""

    _board: Board
