"""A mission made ready to run: a flat list of instructions, plain values that outlive the process.

Repeats are jumps, so that the whole position of a run is one index and its loop counters.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec


class Act(msgspec.Struct, frozen=True, omit_defaults=True):
    """What one robot does: a verb with its value; ``timeout`` in seconds, extended by progress."""

    verb: str
    value: Any
    data: dict[str, Any] = {}
    speed: float | None = None
    timeout: float = 600.0
    retry: int = 0

    @property
    def words(self) -> str:
        """For people."""
        return str(self.value) if self.verb == "command" else self.verb


class Condition(msgspec.Struct, frozen=True, omit_defaults=True):
    """Something that is so of any or all robots of a role (``all``: of the run)."""

    role: str
    every: bool = False
    battery_min: float | None = None
    battery_max: float | None = None
    health: str = ""
    event: str = ""


class Require(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a robot must have before it moves; ``health`` is the worst word that will do."""

    health: str = "degraded"
    battery_min: float | None = None
    battery_max: float | None = None

    def with_(self, other: Require) -> Require:
        """Return what both require."""
        least = [each for each in (self.battery_min, other.battery_min) if each is not None]
        most = [each for each in (self.battery_max, other.battery_max) if each is not None]
        return Require(
            "ok" if "ok" in (self.health, other.health) else self.health,
            max(least, default=None),
            min(most, default=None),
        )


class Do(msgspec.Struct, frozen=True, omit_defaults=True, tag="do"):
    """Robots do something. ``acts`` by role: one for all of its robots, or one for each of them."""

    id: str
    acts: dict[str, tuple[Act, ...]]
    only_if: Condition | None = None
    finish: str = "all"
    together: bool = False
    failed_do: str = "hold"
    failed_then: Literal["continue", "wait", "fail"] = "continue"
    undo: dict[str, tuple[Act, ...]] = {}
    require: Require | None = None  # in a mission within the mission; else that of the program


class Wait(msgspec.Struct, frozen=True, omit_defaults=True, tag="wait"):
    """Wait some seconds."""

    id: str
    seconds: float
    only_if: Condition | None = None


class WaitFor(msgspec.Struct, frozen=True, omit_defaults=True, tag="wait_for"):
    """Wait until something is so."""

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
    """The beginning of a repeat, whose instructions end at ``end`` (the index behind its ``Again``)."""

    id: str
    times: int
    end: int
    until: Condition | None = None
    only_if: Condition | None = None


class Again(msgspec.Struct, frozen=True, omit_defaults=True, tag="again"):
    """The end of a repeat: back to ``loop``, the index of its beginning."""

    loop: int
    id: str = ""
    only_if: Condition | None = None


class Enter(msgspec.Struct, frozen=True, omit_defaults=True, tag="enter"):
    """The beginning of a mission within the mission; its instructions end at ``end``, behind its ``Leave``.

    ``role`` has all of its robots. When it fails (``quorum``, ``deadline`` in seconds), they have failed in
    the step that carries it, and ``failed_do`` and ``failed_then`` say what follows.
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
    """The end of a mission within the mission, which began at the index ``enter``."""

    enter: int
    id: str = ""
    only_if: Condition | None = None


Instruction = Do | Wait | WaitFor | Ask | Loop | Again | Enter | Leave


class RoleNeed(msgspec.Struct, frozen=True, omit_defaults=True):
    """Which robots fill a role of a mission within the mission, and how many."""

    least: int
    most: int
    source: str | None = None  # a group or a robot
    kind: str | None = None
    can: tuple[str, ...] = ()


class Inner(msgspec.Struct, frozen=True, omit_defaults=True):
    """A mission within the mission: the role that carries it, and its own roles, by their full names."""

    carrier: str
    roles: dict[str, RoleNeed]
    require: Require


class Program(msgspec.Struct, frozen=True, omit_defaults=True):
    """One run's frozen copy of its mission. ``quorum``: robots that each role must keep.

    ``inner`` has the missions within it by the name of their step, the outer ones first. Their roles are
    named after that step (``round.eye``), ``round.all`` is every robot of it.
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
