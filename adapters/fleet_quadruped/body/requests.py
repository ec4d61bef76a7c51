"""Requests to the body: tables of the modes that accept them, and reasons for refusals."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.safety.stages import BodyMode

UPRIGHT_FROM = 0.85  # upward component of the body's z axis that rising needs
_LEVEL = 0.15  # rad: largest tilt at the start of a check


class BodyRequest(enum.StrEnum):
    """Requests to the body."""

    STAND = "stand"
    SIT = "sit"
    RECOVER = "recover"
    CHECK = "check"
    HEIGHT = "height"
    POSE = "pose"
    RESET = "reset"


STANDS = frozenset({BodyMode.STANDING, BodyMode.WALKING})
ALREADY: Mapping[BodyRequest, frozenset[BodyMode]] = MappingProxyType(
    {
        BodyRequest.STAND: STANDS | {BodyMode.RISING},
        BodyRequest.RECOVER: STANDS,
        BodyRequest.SIT: frozenset({BodyMode.OFF, BodyMode.SITTING, BodyMode.SETTLING}),
    }
)
"""Modes that already meet a request, or are about to."""
ENTERED: Mapping[tuple[BodyRequest, BodyMode], BodyMode] = MappingProxyType(
    {
        (BodyRequest.SIT, BodyMode.RECOVERING): BodyMode.SETTLING,  # it lies already: damp it in this posture
        (BodyRequest.SIT, BodyMode.STANDING): BodyMode.SITTING,
        (BodyRequest.SIT, BodyMode.WALKING): BodyMode.SITTING,
        (BodyRequest.SIT, BodyMode.POSING): BodyMode.SITTING,
        (BodyRequest.SIT, BodyMode.HELD): BodyMode.SITTING,
    }
)
"""Requests that change the mode directly."""
STARTED: Mapping[BodyRequest, BodyMode] = MappingProxyType(
    {
        BodyRequest.STAND: BodyMode.RISING,
        BodyRequest.POSE: BodyMode.POSING,
        BodyRequest.RECOVER: BodyMode.RECOVERING,
        BodyRequest.CHECK: BodyMode.CHECKING,
    }
)
"""Requests that enable the drives of a robot that is off, and the mode that follows."""


def refusal(
    request: BodyRequest, mode: BodyMode, fault: str, imu: MeasuredImu | None, *, can_roll: bool
) -> str:
    """Return the reason against enabling the drives for a request; empty if there is none.

    ``fault``: the latched fault; ``can_roll``: the description has roll poses.
    """
    if mode is not BodyMode.OFF or request not in STARTED:
        return f"it is {mode.value}; stop it first" if request is BodyRequest.POSE else f"it is {mode.value}"
    if fault:
        return f"a fault is latched: {fault}; look at the dog, then send reset_faults"
    return _LIES_WRONGLY[request](imu, can_roll)


def _not_upright(hint: str) -> Callable[[MeasuredImu | None, bool], str]:
    def why(imu: MeasuredImu | None, _can_roll: bool) -> str:  # noqa: FBT001 - table signature
        return f"it is not upright; {hint}" if imu is not None and imu.up < UPRIGHT_FROM else ""

    return why


def _cannot_recover(imu: MeasuredImu | None, can_roll: bool) -> str:  # noqa: FBT001 - table signature
    if imu is None:
        return "its attitude is unknown without an IMU"
    if imu.up < UPRIGHT_FROM and not can_roll:
        return "it is not upright and its description has no roll poses; put it on its feet"
    return ""


def _cannot_be_checked(imu: MeasuredImu | None, _can_roll: bool) -> str:  # noqa: FBT001 - table signature
    if imu is None:
        return "its attitude is unknown without an IMU"
    if imu.tilt > _LEVEL:
        return f"it lies tilted by {imu.tilt:.2f} rad; put it on a level floor, on its belly"
    return ""


_LIES_WRONGLY: Mapping[BodyRequest, Callable[[MeasuredImu | None, bool], str]] = MappingProxyType(
    {
        BodyRequest.STAND: _not_upright("send recovery_stand, or check how its IMU is mounted"),
        BodyRequest.POSE: _not_upright("put it on its belly"),
        BodyRequest.RECOVER: _cannot_recover,
        BodyRequest.CHECK: _cannot_be_checked,
    }
)
