"""Names of buckets, keys, subjects and inboxes in the store of roll-outs."""

from __future__ import annotations

DESIRED, OBSERVED = "fleet_desired", "fleet_observed"
BUNDLES, ROLLOUTS = "fleet_bundles", "fleet_rollouts"
CURRENT = "current"  # the key of the roll-out in ROLLOUTS
OPERATOR = "OPERATOR"  # client name of operators; no edge can have this name


def inbox_of(name: str) -> str:
    """Return the inbox prefix for replies to a client; only that client may subscribe to it."""
    return f"_INBOX_{name}"


def subject(bucket: str, key: str) -> str:
    """Return the subject of a key in a bucket."""
    return f"$KV.{bucket}.{key}"
