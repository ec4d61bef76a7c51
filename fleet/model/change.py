"""What a changed fleet.yaml does to a running edge, as it is asked and told on the bus."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

import msgspec

FORMAT = 1
"""The format of these messages; whoever is asked in a newer one says so and does nothing."""


class ChangeKind(StrEnum):
    """What is done with one robot, or one section of fleet.yaml."""

    ADDED = "added"
    REMOVED = "removed"
    REBUILT = "rebuilt"  # its adapter is ended and started again with the new configuration
    SETTINGS = "settings only"  # taken over while the adapter goes on
    RESTART = "restart"  # only the next start of the edge takes it
    UNTOUCHED = "untouched"


class Outcome(StrEnum):
    """What came of a change."""

    PLANNED = "planned"  # nothing was to be done but to tell it
    DONE = "done"
    PARTLY = "partly"  # what is stricter is in use, the rest waits; or all is, and a robot does not answer
    REFUSED = "refused"  # nothing was changed, and why
    FAILED = "failed"  # the configuration of before is in use again


class Change(msgspec.Struct, frozen=True, omit_defaults=True):
    """One robot, or one section.

    ``fields``: what differs, as ``limits.speed: 5.0 -> 3.0``, secrets masked. ``why``: why it needs a
    restart, was refused or failed; of a plan: why it would be refused now.
    """

    name: str
    kind: ChangeKind
    fields: tuple[str, ...] = ()
    why: str = ""
    outcome: Outcome = Outcome.PLANNED
    section: bool = False


class HoldRobot(msgspec.Struct, frozen=True):
    """What a worker is asked of one robot: ``given`` is its configuration as fleet.yaml has it (JSON).

    ``whole``: its adapter goes on with it, so that a robot at rest may take all of it over.
    """

    given: str
    whole: bool = False


class HoldAsked(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a worker is asked: settings of its robots, by name, and groups of the edge; None: as before."""

    robots: dict[str, HoldRobot] = {}
    groups: dict[str, list[str]] | None = None


class HeldRobot(msgspec.Struct, frozen=True, omit_defaults=True):
    """What came of it: ``complete``: it runs with the new configuration; ``changed``: with stricter settings.

    ``settings`` are those that it is held to now (JSON); ``why`` it is held to none of the new ones.
    """

    complete: bool = False
    changed: bool = False
    settings: str = ""
    why: str = ""


class ChangesAsked(msgspec.Struct, frozen=True, omit_defaults=True):
    """``diff`` only tells, ``apply`` does it; ``force``: also to robots in motion; ``by``: who asks.

    ``file``: the path that the asker means; an edge that reads another refuses. ``text``: also tell what the
    file says.
    """

    do: Literal["diff", "apply"] = "diff"
    force: bool = False
    by: str = ""
    file: str = ""
    format: int = FORMAT
    text: bool = False


class ChangesAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """What differs, robots first; or why nothing was looked at, with the ``problems`` of the file.

    ``text`` is what the file says, secrets masked; ``warnings``: what a person should look at, though the
    file can be used.
    """

    changes: tuple[Change, ...] = ()
    file: str = ""
    refusal: str = ""
    problems: tuple[str, ...] = ()
    text: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def same(self) -> bool:
        """True when nothing differs."""
        return not self.refusal and all(change.kind is ChangeKind.UNTOUCHED for change in self.changes)
