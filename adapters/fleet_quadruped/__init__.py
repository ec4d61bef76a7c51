"""Quadrupeds with twelve joint drives on CAN: CiA 402, MIT, ODrive or moteus."""

from fleet_quadruped.adapter import QuadrupedAdapter, QuadrupedConfig

__all__ = ["QuadrupedAdapter", "QuadrupedConfig"]
