"""Quadrupeds with twelve joint drives on CAN: CiA 402, MIT, ODrive or moteus.

Names are loaded on first use: the process of the body controller does not load the adapter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fleet_quadruped.adapter import QuadrupedAdapter, QuadrupedConfig

__all__ = ["QuadrupedAdapter", "QuadrupedConfig"]


def __getattr__(name: str) -> object:
    """Load the adapter when one of its names is first used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from fleet_quadruped import adapter  # noqa: PLC0415 - on first use

    return getattr(adapter, name)
