"""The accounts of a NATS server for roll-outs: what an edge, and who rolls out, may read and write. Pure."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from fleet.rollout.names import BUNDLES, DESIRED, OBSERVED, OPERATOR, inbox_of, subject


def edge_permissions(edge: str) -> dict[str, object]:
    """Return what an edge may do: read its own desired state and bundles, write its own observed state."""
    return {
        "publish": {
            "allow": [
                f"$JS.API.DIRECT.GET.KV_{DESIRED}.{subject(DESIRED, edge)}",
                f"$JS.API.DIRECT.GET.KV_{BUNDLES}.{subject(BUNDLES, '*.*')}",
                subject(OBSERVED, edge),
            ]
        },
        "subscribe": {"allow": [f"{inbox_of(edge)}.>"]},
    }


def operator_permissions() -> dict[str, object]:
    """Return what who rolls out may do; it can read and write all buckets of roll-outs."""
    return {
        "publish": {"allow": ["$JS.API.>", "$KV.>"]},
        "subscribe": {"allow": [f"{inbox_of(OPERATOR)}.>"]},
    }


def server_users(edges: Iterable[str], operators: Iterable[str]) -> str:
    """Return the block of a NATS server's configuration with a user for each edge and operator.

    With ``verify_and_map`` in its block ``tls`` they are known by the name in their certificates.
    """
    users = [{"user": edge, "permissions": edge_permissions(edge)} for edge in edges]
    users += [{"user": name, "permissions": operator_permissions()} for name in operators]
    lines = ",\n".join(f"    {msgspec.json.encode(user).decode()}" for user in users)
    return f"authorization {{\n  users = [\n{lines}\n  ]\n}}\n"
