"""Decoder of Cyberwave's velocity contracts to velocity and lease.

A test checks that the published models (``cyberwave-contracts``) accept the same messages. They are not used
here: that package builds the models of all contracts when it is imported, a quarter of a worker's start.
"""

from __future__ import annotations

from collections.abc import Mapping

from fleet.errors import WireError
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.wire.spelling import refuse_misspelt
from fleet.wire.strict_json import number, optional_number, path, text, whole

SHORTEST_LEASE = 0.15  # s, the minimum to which the SDK clamps it
LONGEST_LEASE = 5.0  # s

AERIAL = "aerial.velocity_command.v1"
LOCOMOTION = "locomotion.velocity_command.v1"
DURATIONS = range(50, 30_001)  # ms; besides 0, a stop
ORIGINS = ("teleop", "ai_policy", "navigation", "workflow")
GAITS = ("walk", "trot", "stand")

_BOTH = {"contract", "linear_x", "linear_y", "angular_z", "duration_ms", "origin"}
_FIELDS = {AERIAL: frozenset({*_BOTH, "linear_z"}), LOCOMOTION: frozenset({*_BOTH, "gait"})}


def read_velocity_contract(body: Mapping[str, object], *, where: str) -> tuple[Velocity, float]:
    """Return the velocity (body frame, signed) and its lease in seconds; a lease of 0.0 means stop.

    A duration of 0 ms and the gait ``stand`` mean stop; any other duration is clamped to 0.15 to 5 s;
    the gaits ``walk`` and ``trot`` are kept. Raises WireError for a violation of the contract.
    """
    contract = body.get("contract")
    fields = _FIELDS.get(contract) if isinstance(contract, str) else None
    if fields is None:
        raise WireError(f"one of {', '.join(_FIELDS)} is needed", where=path(where, "contract"))
    refuse_misspelt(body, fields, where)
    in_air = contract == AERIAL
    linear = Vector3(
        number(body, "linear_x", where),
        optional_number(body, "linear_y", where) or 0.0,
        number(body, "linear_z", where) if in_air else 0.0,
    )
    # The aerial contract has no gait: one beside it is another program's, and only "stand" counts, as a stop.
    gait = "" if in_air else _one_of(GAITS, body, "gait", where)
    velocity = Velocity(linear, number(body, "angular_z", where), gait)
    _one_of(ORIGINS, body, "origin", where)
    duration = whole(body, "duration_ms", where)
    if duration != 0 and duration not in DURATIONS:
        bounds = f"0 or {DURATIONS[0]} to {DURATIONS[-1]} ms is needed"
        raise WireError(f"{bounds}, this is {duration}", where=path(where, "duration_ms"))
    if duration == 0 or body.get("gait") == "stand":
        return ZERO_VELOCITY, 0.0
    return velocity, min(max(duration / 1000.0, SHORTEST_LEASE), LONGEST_LEASE)


def _one_of(words: tuple[str, ...], body: Mapping[str, object], name: str, where: str) -> str:
    """Return the string ``name``; raises WireError if it is not one of ``words``."""
    word = text(body, name, where)
    if word not in words:
        raise WireError(f"one of {', '.join(words)} is needed", where=path(where, name))
    return word
