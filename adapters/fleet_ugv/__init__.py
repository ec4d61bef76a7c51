"""Wheeled robots on a serial line: Waveshare UGV, ros_arduino_bridge, hoverboard FOC."""

from fleet_ugv.adapter import UgvAdapter
from fleet_ugv.config import UgvConfig

__all__ = ["UgvAdapter", "UgvConfig"]
