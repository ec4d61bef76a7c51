"""Permissions of persons at a console, and the permission that each command needs.

The console checks them for its pages, and each edge checks them again for requests from a console.
"""

from __future__ import annotations

import enum

ADMIN_COMMANDS = frozenset({"restart_adapter", "set_parameters", "reboot"})
"""Commands with an effect beyond the robot's next motion."""


class Permission(enum.IntEnum):
    """Permission of a person; each includes the lower ones. Stops need none."""

    VIEW = 1
    OPERATE = 2
    ADMIN = 3

    @property
    def word(self) -> str:
        """Return the name in lower case."""
        return self.name.lower()

    def refusal(self, needed: Permission) -> str:
        """Return why a request that needs another permission is refused, empty when it is allowed."""
        return "" if needed <= self else f"it needs the permission {needed.word}; yours is {self.word}"


def needed_for_command(name: str) -> Permission:
    """Return the permission that a command to a robot needs; stops need none and are not checked here."""
    return Permission.ADMIN if name in ADMIN_COMMANDS else Permission.OPERATE
