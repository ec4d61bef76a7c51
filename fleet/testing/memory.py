"""The robot's end of a ``memory:`` link, in the process of a test."""

from __future__ import annotations

from fleet.link.memory import MemoryRobot

__all__ = ["MemoryRobot"]
