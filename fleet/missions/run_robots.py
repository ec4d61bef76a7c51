"""The robots of one run and their parts: a part begins once, ends, and never begins again.

Only this module creates ``Begin``. It never commands a robot that is not ours, and never uses an identity
twice.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from types import MappingProxyType

import msgspec

from fleet.missions.program import Act
from fleet.missions.state import (
    Begin,
    BeginTogether,
    LogNote,
    PartKind,
    PartOutcome,
    RunEffect,
    RunMember,
    StepPart,
)

SHOWN_PARTS = 6  # newest parts of a robot that users see
HALT_WITHIN = 15.0  # s until a halted robot must be seen standing
HALT = Act("command", "stop", timeout=HALT_WITHIN)
"""Ends motion; the robot holds its position."""
COMES_DOWN = frozenset({"land", "return_to_home", "sit_down"})
"""Commands that only make a robot safer: like the host, a run does not interrupt them with a halt."""
_ENDS: Mapping[PartOutcome, str] = MappingProxyType(
    {
        PartOutcome.DONE: "has finished {}",
        PartOutcome.REFUSED: "was refused {}",
        PartOutcome.FAILED: "failed in {}",
        PartOutcome.LATE: "did not finish {} in time",
        PartOutcome.LOST: "was lost in {}",
        PartOutcome.TAKEN: "was taken in {}",
        PartOutcome.STOPPED: "was stopped in {}",
        PartOutcome.SKIPPED: "was ended in {}",
        PartOutcome.UNKNOWN: "ended {} without being observed",
    }
)
NOT_OURS = frozenset({PartOutcome.LOST, PartOutcome.TAKEN, PartOutcome.STOPPED})


def first_identity(run: str, step: str, robot: str) -> str:
    """Return the identity of a robot's first part in a step of a run."""
    return f"{run}/{step}/{robot}/1"


class RunRobots:
    """Members by robot, parts by identity; ``effects`` collects effects, ``touched`` the changed objects."""

    def __init__(self, run: str, members: Iterable[RunMember], parts: Iterable[StepPart] = ()) -> None:
        self.run = run
        self.members = {member.robot: member for member in members}
        self.parts = {part.identity: part for part in parts}
        self._active = {part.identity: part for part in self.parts.values() if part.inflight}
        in_order = sorted(self.parts.values(), key=lambda part: part.began)
        self._last = {part.robot: part for part in in_order if part.kind != "halt"}
        self.shown_parts = {
            robot: deque(
                (part for part in in_order if part.robot == robot and part.kind != "halt"), SHOWN_PARTS
            )
            for robot in self.members
        }
        self.effects: list[RunEffect] = []
        self.touched: dict[str, StepPart | RunMember] = {}
        self.halts = sum(part.kind == "halt" for part in self.parts.values())

    def note(self, text: str, robot: str = "", step: str = "") -> None:
        """Add a line to the run's log."""
        self.effects.append(LogNote(text, robot, step))

    def within(self, roles: Iterable[str] | None = None) -> list[RunMember]:
        """Return the robots that still take part, of some roles or of all."""
        wanted = None if roles is None else set(roles)
        return [
            each
            for each in self.members.values()
            if each.within and (not wanted or each.role in wanted or not wanted.isdisjoint(each.plays))
        ]

    def plays(self, robot: str, role: str) -> bool:
        """Return True if a robot fills a role, also one of an inner mission."""
        member = self.members[robot]
        return role == member.role or role in member.plays

    def act_of(self, member: RunMember, acts: Mapping[str, tuple[Act, ...]]) -> Act | None:
        """Return a robot's act from acts by role, or None. Its own role takes precedence over all."""
        for role in (member.role, *member.plays, "all"):
            if acts.get(role):
                return self._meant(acts[role][member.plays.get(role, member.index) % len(acts[role])])
        return None

    def _meant(self, act: Act) -> Act:
        """Replace the followed role of a ``follow`` act by its present robot; empty if there is none."""
        if act.verb != "follow":
            return act
        first = next(iter(self.within([act.value])), None)
        return msgspec.structs.replace(act, value=first.robot if first is not None else "")

    def acts_of(self, acts: Mapping[str, tuple[Act, ...]]) -> list[tuple[str, Act]]:
        """Return the act of each robot that still takes part, from acts by role."""
        found = ((each.robot, self.act_of(each, acts)) for each in self.within())
        return [(robot, act) for robot, act in found if act is not None]

    def ours(self) -> list[RunMember]:
        """Return the robots that may be commanded."""
        return [each for each in self.members.values() if each.ours]

    def needs(self, robot: str) -> bool:
        """Return True if the run commands a robot, or may do so later."""
        member = self.members.get(robot)
        return member is not None and (member.within or member.ours or member.spare)

    def active(self, *kinds: PartKind) -> list[StepPart]:
        """Return the active parts of these kinds; without kinds, of all."""
        return [part for part in self._active.values() if not kinds or part.kind in kinds]

    def parts_of(self, step: str) -> list[StepPart]:
        """Return the parts of the robots for one started step."""
        return [part for part in self.parts.values() if part.step == step and part.kind == "do"]

    def begin_together(self, step: str, acts: Iterable[tuple[str, Act]], now: float) -> None:
        """Begin the parts of prepared robots at one instant."""
        before = len(self.effects)
        for robot, act in acts:
            self.begin(step, robot, act, "do", now)
        begins = [each for each in self.effects[before:] if isinstance(each, Begin)]
        self.effects = [each for each in self.effects if each not in begins]
        self.effects.append(BeginTogether(step, tuple(each.part for each in begins)))

    def begin(self, step: str, robot: str, act: Act, kind: PartKind, now: float, *, attempt: int = 1) -> None:
        """Begin a part of a robot, if it is ours."""
        member = self.members[robot]
        if not member.ours:
            return
        mark = {"do": "", "undo": "undo.", "abort": "abort.", "secure": "secure.", "halt": "halt."}[kind]
        number = f"{mark}{attempt}"
        if kind == "halt":
            self.halts += 1
            number = f"halt.{self.halts}"
        identity = f"{self.run}/{step}/{robot}/{number}"
        if identity in self.parts:  # a begun part never begins again
            return
        part = StepPart(identity, step, robot, member.role, attempt, kind, act, now, now + act.timeout)
        self.parts[identity] = self._active[identity] = part
        if kind != "halt":
            self._last[robot] = part
            self.shown_parts[robot].append(part)
        self.touched[identity] = part
        self.effects.append(Begin(part))
        if kind != "halt":
            self.note(f"begins {act.words}", robot, step)

    def halt(self, step: str, robot: str, now: float) -> None:
        """Halt a robot that is ours, unless a halt is active.

        A robot that lands, or may still be landing, is not interrupted.
        """
        if self.comes_down(robot) or any(part.robot == robot for part in self.active("halt")):
            return
        self.begin(step, robot, HALT, "halt", now)

    def comes_down(self, robot: str) -> bool:
        """Return True if a robot executes, or may still execute, a command that only makes it safer."""
        last = self._last.get(robot)
        if last is None or last.act.verb != "command" or last.act.value not in COMES_DOWN:
            return False
        return last.outcome in (None, PartOutcome.LATE, PartOutcome.UNKNOWN)

    def end(self, part: StepPart, outcome: PartOutcome, reason: str, now: float) -> None:
        """Record the end of a part; a recorded end is final."""
        if not part.inflight:
            return
        part.outcome, part.reason, part.ended = outcome, reason, now
        self._active.pop(part.identity, None)
        self.touched[part.identity] = part
        if part.kind != "halt" or outcome is not PartOutcome.DONE:
            words = "to stop" if part.kind == "halt" else part.act.words
            self.note(_ENDS[outcome].format(words) + (f": {reason}" if reason else ""), part.robot, part.step)

    def lose(self, robot: str, outcome: PartOutcome, reason: str, now: float) -> bool:
        """Remove a robot from the run; return True if it took part.

        Its active part ends with the same outcome. A robot that was taken, was stopped or does not answer is
        no longer ours; this can also happen to a robot that was removed before.
        """
        member = self.members[robot]
        was_within = member.within
        if was_within:
            member.outcome, member.reason, member.since = outcome, reason, now
        member.within = member.spare = False
        if outcome in NOT_OURS:
            member.ours = False
        self.touched[f"member {robot}"] = member
        for part in self.active():
            if part.robot == robot and (part.kind == "do" or outcome in NOT_OURS):
                self.end(part, outcome, reason, now)
        if was_within:
            self.note(f"is out of the run, {outcome}: {reason}", robot)
        return was_within

    def spares(self, role: str) -> list[RunMember]:
        """Return the spares of a role (``all``: of every role)."""
        return [each for each in self.members.values() if each.spare and role in (each.role, "all")]

    def shortage(self, quorum: dict[str, int], *, with_spares: bool = False) -> str:
        """Return which role has fewer robots than its quorum; empty if none has."""
        for role, least in quorum.items():
            left = len(self.within([role])) + (len(self.spares(role)) if with_spares else 0)
            if left < least:
                return f"role {role} has {left} of the {least} robots that it needs"
        return ""

    def has_lost_robot(self) -> bool:
        """Return True if a robot did not stay in the run to the end."""
        return any(not each.within and not each.spare for each in self.members.values())
