"""Loss of a robot: it is made safe, and the mission continues, asks or fails.

An inner mission fails only for its own robots; the step that contains it defines what follows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from fleet.missions.ending import Ending
from fleet.missions.inner_missions import InnerMissions
from fleet.missions.program import Act, Do, Enter, Program
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import GOING_ON, PartOutcome, Phase, Question, RunHead, instruction_of, step_name

ANSWERED_WITHIN = 600.0  # s for questions of the engine itself
Then = Literal["continue", "wait", "fail"]


class RobotLosses:
    """Handles the losses of one run; ``now`` is the time of the event, ``check`` checks the step."""

    def __init__(
        self,
        program: Program,
        head: RunHead,
        robots: RunRobots,
        inner: InnerMissions,
        *,
        ending: Ending,
        check: Callable[[], None],
    ) -> None:
        self._program = program
        self._head = head
        self._robots = robots
        self._inner = inner
        self._ending = ending
        self._check = check
        self.now = 0.0

    def lose(self, robot: str, outcome: PartOutcome, reason: str) -> None:
        """Remove a robot from the run, make it safe, and decide whether the run continues."""
        if not self._robots.lose(robot, outcome, reason, self.now) or self._head.phase not in GOING_ON:
            return
        step = instruction_of(self._program, self._head)
        doing = step if isinstance(step, Do) else None
        self._make_safe(robot, doing.failed_do if doing is not None else "hold")
        for follower in self._followers(robot):
            self.lose(follower, PartOutcome.FAILED, f"it followed {robot}, which is out of the run")
        if self._head.phase in GOING_ON:
            then: Then = doing.failed_then if doing is not None else "continue"
            self._follow(f"{robot}: {outcome}: {reason}", then)

    def _followers(self, robot: str) -> list[str]:
        """Return the robots that follow another one."""
        parts = self._robots.active("do")
        return [part.robot for part in parts if part.act.verb == "follow" and part.act.value == robot]

    def fail(self, reason: str) -> None:
        """Fail the mission in progress: the innermost, or the run itself."""
        inner = self._inner.under_way()
        if inner:
            self._fail_mission(*inner[-1], reason)
        else:
            self._ending.fail(reason, self.now)

    def time_passes(self) -> None:
        """Fail an inner mission past its deadline."""
        late = self._inner.late(self.now)
        if late is not None:
            at, inner = late
            self._fail_mission(at, inner, f"its deadline of {inner.deadline:g} s is over")

    def ask(self, text: str, about: Literal["robot", "restart", "resume"]) -> None:
        """Ask a question of the engine; without an answer the run is aborted."""
        put_question(
            self._head,
            self._robots,
            step_name(self._program, self._head),
            text,
            until=self.now + ANSWERED_WITHIN,
            about=about,
        )

    def _fail_mission(self, at: int, inner: Enter, reason: str) -> None:
        """Fail an inner mission: its robots have failed in the step that contains it."""
        why = f"mission {inner.mission} failed: {reason}"
        self._robots.note(f"The {why}", step=inner.id)
        self._inner.skip_to_end(at, inner)
        for member in self._robots.within([inner.role]):
            self._robots.lose(member.robot, PartOutcome.FAILED, why, self.now)
            self._make_safe(member.robot, inner.failed_do)
        self._follow(why, inner.failed_then)
        self._check()

    def _make_safe(self, robot: str, how: str) -> None:
        """Halt a removed robot, or give it the command that the step defines instead."""
        name = step_name(self._program, self._head)
        if how == "hold":
            self._robots.halt(name, robot, self.now)
        else:
            self._robots.begin(name, robot, Act("command", how), "secure", self.now)

    def _follow(self, why: str, then: Then) -> None:
        """Check the quorum of the run and of each inner mission in progress, and act on a shortage."""
        shortage = self._robots.shortage(self._program.quorum, with_spares=True)
        if shortage:
            self._ending.fail(f"{why}; {shortage}", self.now)
            return
        for at, step in self._inner.under_way():
            shortage = self._robots.shortage(step.quorum)
            if shortage:
                self._fail_mission(at, step, f"{why}; {shortage}")
                return
        if then == "fail":
            self.fail(why)
        elif then == "wait" and self._begin_asking():
            self.ask(f"{why}. Continue without it?", "robot")

    def _begin_asking(self) -> bool:
        """Let the step in progress wait for a person; False if none is, or a person is asked already.

        A paused run asks too, and takes the answer once it is resumed.
        """
        head = self._head
        if head.phase in (Phase.STEP, Phase.PREPARING):
            head.phase = Phase.ASKING
            return True
        if head.phase is Phase.PAUSED and head.paused_from is Phase.STEP and head.question is None:
            head.paused_from = Phase.ASKING
            return True
        return False


def put_question(
    head: RunHead,
    robots: RunRobots,
    step: str,
    text: str,
    *,
    until: float,
    about: Literal["step", "robot", "restart", "resume"] = "step",
    on_timeout: Literal["continue", "abort", "fail"] = "abort",
) -> None:
    """Ask a person a question; without an answer by ``until``, ``on_timeout`` applies."""
    head.questions += 1
    head.question = Question(head.questions, text, until, on_timeout, about)
    robots.note(f"A person is asked: {text}", step=step)
