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


Instruction = Do | Wait | WaitFor | Ask | Loop | Again


class Require(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a robot must have before it moves; ``health`` is the worst word that will do."""

    health: str = "degraded"
    battery_min: float | None = None
    battery_max: float | None = None


class Program(msgspec.Struct, frozen=True, omit_defaults=True):
    """One run's frozen copy of its mission. ``quorum``: robots that each role must keep."""

    mission: str
    steps: tuple[Instruction, ...]
    quorum: dict[str, int]
    require: Require = Require()
    occupies: tuple[str, ...] = ()
    deadline: float | None = None
    on_failure: Literal["hold", "undo", "stop"] = "hold"
    on_abort: str = "hold"
    on_restart: Literal["fail", "hold_and_ask", "continue"] = "hold_and_ask"
