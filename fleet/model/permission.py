"""What a person at a console may do, and which of it a command needs.

The console checks it for its pages, and each edge checks it again for what comes from a console.
"""

from __future__ import annotations

import enum

ADMIN_COMMANDS = frozenset({"restart_adapter", "set_parameters", "reboot"})
"""Commands that change a robot for longer than its next motion."""


class Permission(enum.IntEnum):
    """What a person may do; each includes those before it. Everybody may stop robots."""

    VIEW = 1
    OPERATE = 2
    ADMIN = 3

    @property
    def word(self) -> str:
        """Return it as one word."""
        return self.name.lower()

    def refusal(self, needed: Permission) -> str:
        """Return why what needs another permission is refused, empty when it is not."""
        return "" if needed <= self else f"it needs the permission {needed.word}; yours is {self.word}"


def needed_for_command(name: str) -> Permission:
    """Return the permission that a command to a robot needs; a stop needs none, and is not asked here."""
    return Permission.ADMIN if name in ADMIN_COMMANDS else Permission.OPERATE
