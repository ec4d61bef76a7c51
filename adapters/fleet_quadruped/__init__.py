"""Quadrupeds whose twelve joint drives sit on CAN: CiA 402 or MIT."""

from fleet_quadruped.adapter import QuadrupedAdapter, QuadrupedConfig

__all__ = ["QuadrupedAdapter", "QuadrupedConfig"]
