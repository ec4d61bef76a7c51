"""The physical machine behind a robot's configuration."""

from __future__ import annotations

from fleet.robot_config import AdapterConfig

ValueIdentity = tuple[object, str]
"""The class of the config (or name of the adapter), and the machine."""


def identity_of(config: AdapterConfig) -> ValueIdentity | None:
    """Return the machine of a config, if the config identifies one.

    A config may define ``identity() -> str | None``: equal for two configs of one class that reach the same
    machine (for example the same link and system id), None if that is not possible.
    """
    identity = getattr(config, "identity", None)
    value = identity() if callable(identity) else None
    return None if value is None else (type(config), value)
