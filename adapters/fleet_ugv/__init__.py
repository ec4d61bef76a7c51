"""Wheeled robots on a serial line: Waveshare UGV, ros_arduino_bridge, hoverboard FOC.

A plugin for another board subclasses ``UgvAdapter``, and brings a ``Codec`` and a ``BaseProfile``
(``plugins/roboclaw.py``).
"""

from fleet_ugv.adapter import UgvAdapter
from fleet_ugv.battery import THREE_LITHIUM
from fleet_ugv.codecs.base import Codec
from fleet_ugv.config import UgvConfig
from fleet_ugv.model import Confirmed, Feedback, Motion, UgvEvent, Wheels
from fleet_ugv.profiles import BaseProfile, CodecSettings

__all__ = [
    "THREE_LITHIUM",
    "BaseProfile",
    "Codec",
    "CodecSettings",
    "Confirmed",
    "Feedback",
    "Motion",
    "UgvAdapter",
    "UgvConfig",
    "UgvEvent",
    "Wheels",
]
