"""Changes of fleet.yaml on a running edge: requests and answers on the bus."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

import msgspec

FORMAT = 1
"""Format of these messages; a request in a newer format is refused."""


class ChangeKind(StrEnum):
    """How one robot, or one section of fleet.yaml, is changed."""

    ADDED = "added"
    REMOVED = "removed"
    REBUILT = "rebuilt"  # its adapter is restarted with the new configuration
    SETTINGS = "settings only"  # applied while the adapter keeps running
    RESTART = "restart"  # applied at the next start of the edge
    UNTOUCHED = "untouched"


class Outcome(StrEnum):
    """Outcome of a change."""

    PLANNED = "planned"  # only shown, as requested
    DONE = "done"
    PARTLY = "partly"  # the stricter part is in use, the rest waits; or all is, and a robot does not answer
    REFUSED = "refused"  # nothing was changed
    FAILED = "failed"  # the previous configuration is in use again


class Change(msgspec.Struct, frozen=True, omit_defaults=True):
    """The change of one robot, or one section.

    ``fields``: the differences, as ``limits.speed: 5.0 -> 3.0``, secrets masked. ``why``: why it needs a
    restart, was refused or failed; in a plan: why it would be refused now.
    """

    name: str
    kind: ChangeKind
    fields: tuple[str, ...] = ()
    why: str = ""
    outcome: Outcome = Outcome.PLANNED
    section: bool = False


class HoldRobot(msgspec.Struct, frozen=True):
    """New configuration of one robot for its worker: ``given`` is its part of fleet.yaml (JSON).

    ``whole``: the adapter can keep running with it, so a robot at rest may apply all of it.
    """

    given: str
    whole: bool = False


class HoldRequest(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request to a worker: settings of its robots, by name, and groups of the edge; None: unchanged."""

    robots: dict[str, HoldRobot] = {}
    groups: dict[str, list[str]] | None = None


class HeldRobot(msgspec.Struct, frozen=True, omit_defaults=True):
    """Result for one robot; ``complete``: all of the configuration is in use; ``changed``: a stricter part.

    ``settings`` are those in force now (JSON); ``why`` is the reason if none of the new ones is.
    """

    complete: bool = False
    changed: bool = False
    settings: str = ""
    why: str = ""


class ChangesRequest(msgspec.Struct, frozen=True, omit_defaults=True):
    """Request to an edge: ``diff`` shows the changes, ``apply`` makes them.

    ``force``: also for robots in motion; ``by``: the sender. ``file``: the path that the sender means; an
    edge that reads another file refuses. ``text``: also return the content of the file.
    """

    do: Literal["diff", "apply"] = "diff"
    force: bool = False
    by: str = ""
    file: str = ""
    format: int = FORMAT
    text: bool = False


class ChangesAnswer(msgspec.Struct, frozen=True, omit_defaults=True):
    """The changes, robots first; or a ``refusal``, with the ``problems`` of the file.

    ``text`` is the content of the file, secrets masked; ``warnings``: what the user should check in a valid
    file.
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
