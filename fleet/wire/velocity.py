"""Decoder of Cyberwave's velocity contracts, validated by the published models, to velocity and lease."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from cyberwave_contracts import AerialVelocityCommandV1, LocomotionVelocityCommandV1
from pydantic import ValidationError

from fleet.errors import WireError
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.wire.spelling import refuse_misspelt
from fleet.wire.strict import path

SHORTEST_LEASE = 0.15  # s, the minimum to which the SDK clamps it
LONGEST_LEASE = 5.0  # s

Contract = AerialVelocityCommandV1 | LocomotionVelocityCommandV1

_CONTRACTS: Mapping[str, type[Contract]] = MappingProxyType(
    {
        "aerial.velocity_command.v1": AerialVelocityCommandV1,
        "locomotion.velocity_command.v1": LocomotionVelocityCommandV1,
    }
)


def read_velocity_contract(body: Mapping[str, object], *, where: str) -> tuple[Velocity, float]:
    """Return the velocity (body frame, signed) and its lease in seconds; a lease of 0.0 means stop.

    A duration of 0 ms and the gait ``stand`` mean stop; any other duration is clamped to 0.15 to 5 s;
    the gaits ``walk`` and ``trot`` are kept. Raises WireError for a violation of the contract.
    """
    contract = body.get("contract")
    model = _CONTRACTS.get(contract) if isinstance(contract, str) else None
    if model is None:
        raise WireError(f"one of {', '.join(_CONTRACTS)} is needed", where=path(where, "contract"))
    refuse_misspelt(body, frozenset(model.model_fields), where)
    try:
        command = model.model_validate(dict(body))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise WireError(first["msg"], where=path(where, place)) from None
    if command.duration_ms == 0 or body.get("gait") == "stand":
        return ZERO_VELOCITY, 0.0
    # Not getattr: the models keep unknown members as they came, and a gait in the aerial contract is one.
    gait = command.gait if isinstance(command, LocomotionVelocityCommandV1) else ""
    linear = Vector3(command.linear_x, command.linear_y, getattr(command, "linear_z", 0.0))
    lease = min(max(command.duration_ms / 1000.0, SHORTEST_LEASE), LONGEST_LEASE)
    return Velocity(linear, command.angular_z, gait), lease
