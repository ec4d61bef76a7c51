"""The names of everything in the store of roll-outs."""

from __future__ import annotations

DESIRED, OBSERVED = "fleet_desired", "fleet_observed"
BUNDLES, ROLLOUTS = "fleet_bundles", "fleet_rollouts"
CURRENT = "current"  # the key of the roll-out in ROLLOUTS
OPERATOR = "OPERATOR"  # who rolls out; no edge has such a name


def inbox_of(name: str) -> str:
    """Return where answers to an account come; nobody else may listen there."""
    return f"_INBOX_{name}"


def subject(bucket: str, key: str) -> str:
    """Return the subject of a key of a bucket."""
    return f"$KV.{bucket}.{key}"
