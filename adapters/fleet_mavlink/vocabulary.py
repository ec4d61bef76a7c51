"""What each kind of vehicle lacks of the adapter's vocabulary, by name, with the reason."""

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
_ON_THE_SURFACE = "it moves on the surface: it neither takes off nor changes its height"
_ALONG_ITS_NOSE = "it moves along its nose only, not sideways"
SURFACE: Mapping[str, str] = {
    **dict.fromkeys(
        ("takeoff", "land", "cancel_takeoff", "cancel_landing", "ascend", "descend"), _ON_THE_SURFACE
    ),
    **dict.fromkeys(("strafe_left", "strafe_right"), _ALONG_ITS_NOSE),
}
"""A rover or a boat that moves along its nose."""

OF_A_MOVED_VEHICLE = (
    *VERBS,
    "goto",
    "plan",
    "takeoff",
    "land",
    "return_to_home",
    "arm",
    "check_ready",
    "get_parameters",
    "set_parameter",
    "set_failsafes",
    "start_compass_calibration",
    "stop_compass_calibration",
)
"""What takes an autopilot and a type of vehicle that are known here; a stop does not."""
