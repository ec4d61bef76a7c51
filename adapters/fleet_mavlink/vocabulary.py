"""Commands of the adapter's vocabulary that each kind of vehicle lacks, by name, with the reason."""

from __future__ import annotations

from collections.abc import Mapping

VERBS = (
    "move_forward",
    "move_backward",
    "strafe_left",
    "strafe_right",
    "ascend",
    "descend",
    "turn_left",
    "turn_right",
)
_LEVEL = tuple(verb for verb in VERBS if verb not in {"ascend", "descend"})
_ON_THE_SURFACE = "it moves on the surface: it neither takes off nor changes its height"
_ALONG_ITS_NOSE = "it moves along its nose only, not sideways"
_NO_TRANSITION = "it has one way to move only: it is no VTOL"
_UNSET = "a QuadPlane is moved only with Q_GUIDED_MODE 1: send set_failsafes, or set it, on the ground"
ON_WINGS = "it flies on its wings and never stands: it takes goals, which it circles, and no velocities"
NO_VELOCITIES = "ArduPlane takes no velocities, in its hover either: send a goal"
PX4_ROVER = ", because holding and stopping of PX4 rovers was never measured; rovers on ArduPilot are moved"
NO_TRANSITION: Mapping[str, str] = {"transition": _NO_TRANSITION}
"""Lacking on all vehicles but VTOLs."""
SURFACE: Mapping[str, str] = {
    **dict.fromkeys(
        ("takeoff", "land", "cancel_takeoff", "cancel_landing", "ascend", "descend"), _ON_THE_SURFACE
    ),
    **dict.fromkeys(("strafe_left", "strafe_right"), _ALONG_ITS_NOSE),
    **NO_TRANSITION,
}
"""Lacking on a rover or a boat that moves along its nose."""
WINGS_AND_ROTORS: Mapping[str, str] = dict.fromkeys(_LEVEL, ON_WINGS)
"""Lacking on a VTOL on its wings."""
WINGS: Mapping[str, str] = {**WINGS_AND_ROTORS, **NO_TRANSITION}
"""Lacking on a plane."""
HOVERING: Mapping[str, str] = dict.fromkeys(_LEVEL, NO_VELOCITIES)
"""Lacking on a QuadPlane."""
UNSET_QUADPLANE: Mapping[str, str] = {
    **HOVERING,
    **dict.fromkeys(("takeoff", "goto", "plan", "ascend", "descend", "transition"), _UNSET),
}
"""Lacking on a QuadPlane whose GUIDED does not hover."""

OF_A_MOVED_VEHICLE = (
    *VERBS,
    "goto",
    "plan",
    "takeoff",
    "land",
    "return_to_home",
    "transition",
    "arm",
    "check_ready",
    "get_parameters",
    "set_parameter",
    "set_failsafes",
    "start_compass_calibration",
    "stop_compass_calibration",
)
"""Commands that need a known autopilot and vehicle type; a stop does not."""
