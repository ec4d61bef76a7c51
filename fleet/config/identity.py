"""The machine that the configuration of a robot stands for."""

from __future__ import annotations

from fleet.robot_config import AdapterConfig

Identity = tuple[object, str]
"""A kind of robot, and the very machine."""


def identity_of(config: AdapterConfig) -> Identity | None:
    """Return what machine a config stands for, as far as it tells.

    A config may define ``identity() -> str | None``: equal for two configs of one class that reach the
    very same machine (the same link and system id, say), None when that cannot happen.
    """
    identity = getattr(config, "identity", None)
    value = identity() if callable(identity) else None
    return None if value is None else (type(config), value)
