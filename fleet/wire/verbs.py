"""The motion verbs of the vocabulary: which axis each moves a robot along, and in which direction."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

Axis = Literal["x", "y", "z", "yaw"]


class Verb(msgspec.Struct, frozen=True):
    """Axis and sign of a motion verb; ``default`` is the field of ``MotionDefaults`` it falls back to."""

    axis: Axis
    sign: int
    own_field: str
    default: str


VERBS: Mapping[str, Verb] = MappingProxyType(
    {
        "move_forward": Verb("x", 1, "linear_x", "forward"),
        "move_backward": Verb("x", -1, "linear_x", "forward"),
        "strafe_left": Verb("y", 1, "linear_y", "lateral"),
        "strafe_right": Verb("y", -1, "linear_y", "lateral"),
        "ascend": Verb("z", 1, "linear_z", "vertical"),
        "descend": Verb("z", -1, "linear_z", "vertical"),
        "turn_left": Verb("yaw", 1, "angular_z", "yaw_rate"),
        "turn_right": Verb("yaw", -1, "angular_z", "yaw_rate"),
    }
)
