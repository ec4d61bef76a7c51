"""An executable mission: a flat list of instructions, in plain values that are stored across restarts.

Repeats are jumps, so the whole position of a run is one index and its loop counters.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec


class Act(msgspec.Struct, frozen=True, omit_defaults=True):
    """An act of one robot: a verb with its value; ``timeout`` in seconds, extended by progress."""

    verb: str
    value: Any
    data: dict[str, Any] = {}
    speed: float | None = None
    timeout: float = 600.0
    retry: int = 0

    @property
    def words(self) -> str:
        """Short description."""
        return str(self.value) if self.verb == "command" else self.verb


class Condition(msgspec.Struct, frozen=True, omit_defaults=True):
    """A condition on any or all robots of a role (``all``: of the run)."""

    role: str
    every: bool = False
    battery_min: float | None = None
    battery_max: float | None = None
    health: str = ""
    event: str = ""


class Require(msgspec.Struct, frozen=True, omit_defaults=True):
    """Requirements of a robot before it moves; ``health`` is the worst permitted level."""

    health: str = "degraded"
    battery_min: float | None = None
    battery_max: float | None = None

    def with_(self, other: Require) -> Require:
        """Return the combined requirements."""
        least = [each for each in (self.battery_min, other.battery_min) if each is not None]
        most = [each for each in (self.battery_max, other.battery_max) if each is not None]
        return Require(
            "ok" if "ok" in (self.health, other.health) else self.health,
            max(least, default=None),
            min(most, default=None),
        )


class Do(msgspec.Struct, frozen=True, omit_defaults=True, tag="do"):
    """Robots act. ``acts`` by role: one for all of its robots, or one for each of them."""

    id: str
    acts: dict[str, tuple[Act, ...]]
    only_if: Condition | None = None
    finish: str = "all"
    together: bool = False
    failed_do: str = "hold"
    failed_then: Literal["continue", "wait", "fail"] = "continue"
    undo: dict[str, tuple[Act, ...]] = {}
    require: Require | None = None  # in an inner mission; otherwise the program's applies


class Wait(msgspec.Struct, frozen=True, omit_defaults=True, tag="wait"):
    """Wait some seconds."""

    id: str
    seconds: float
    only_if: Condition | None = None


class WaitFor(msgspec.Struct, frozen=True, omit_defaults=True, tag="wait_for"):
    """Wait until a condition holds."""

    id: str
    condition: Condition
    timeout: float
    fails: bool = True
    only_if: Condition | None = None


class Ask(msgspec.Struct, frozen=True, omit_defaults=True, tag="ask"):
    """Ask a person."""

    id: str
    text: str
    timeout: float
    on_timeout: Literal["continue", "abort", "fail"] = "abort"
    only_if: Condition | None = None


class Loop(msgspec.Struct, frozen=True, omit_defaults=True, tag="loop"):
    """Start of a repeat whose instructions end at ``end``, the index after its ``Again``."""

    id: str
    times: int
    end: int
    until: Condition | None = None
    only_if: Condition | None = None


class Again(msgspec.Struct, frozen=True, omit_defaults=True, tag="again"):
    """End of a repeat: jump to ``loop``, the index of its start."""

    loop: int
    id: str = ""
    only_if: Condition | None = None


class Enter(msgspec.Struct, frozen=True, omit_defaults=True, tag="enter"):
    """Start of an inner mission; its instructions end at ``end``, the index after its ``Leave``.

    ``role`` contains all of its robots. If it fails (``quorum``, ``deadline`` in seconds), they have failed
    in the step that contains it, and ``failed_do`` and ``failed_then`` apply.
    """

    id: str
    mission: str
    role: str
    end: int
    quorum: dict[str, int]
    deadline: float | None = None
    failed_do: str = "hold"
    failed_then: Literal["continue", "wait", "fail"] = "continue"
    only_if: Condition | None = None


class Leave(msgspec.Struct, frozen=True, omit_defaults=True, tag="leave"):
    """End of the inner mission that starts at the index ``enter``."""

    enter: int
    id: str = ""
    only_if: Condition | None = None


Instruction = Do | Wait | WaitFor | Ask | Loop | Again | Enter | Leave


class RoleNeed(msgspec.Struct, frozen=True, omit_defaults=True):
    """Requirements of a role of an inner mission, and the number of its robots."""

    least: int
    most: int
    source: str | None = None  # a group or a robot
    kind: str | None = None
    can: tuple[str, ...] = ()


class Inner(msgspec.Struct, frozen=True, omit_defaults=True):
    """An inner mission: the role that executes it, and its own roles by their full names."""

    carrier: str
    roles: dict[str, RoleNeed]
    require: Require


class Program(msgspec.Struct, frozen=True, omit_defaults=True):
    """A run's frozen copy of its mission. ``quorum``: robots that each role must keep.

    ``inner`` has the inner missions by the name of their step, outer ones first. Their roles are prefixed
    with the name of that step (``round.eye``); ``round.all`` is every robot of the inner mission.
    """

    mission: str
    steps: tuple[Instruction, ...]
    quorum: dict[str, int]
    require: Require = Require()
    occupies: tuple[str, ...] = ()
    occupy_within: float = 600.0
    deadline: float | None = None
    on_failure: Literal["hold", "undo", "stop"] = "hold"
    on_abort: str = "hold"
    on_restart: Literal["fail", "hold_and_ask", "continue"] = "hold_and_ask"
    inner: dict[str, Inner] = {}
