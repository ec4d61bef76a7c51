"""The grammar of a mission, ``version: 1``, in fleet.yaml and mission files.

It is closed on purpose: no templates, no expressions, no embedded code. So a mission can be checked with line
and column, drawn, rehearsed, and read again after a crash. ``short_forms.normalised`` expands short forms and
replaces ``{input: NAME}`` by values before the models validate the data.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from fleet.missions.points import MOST_POINTS, is_point, point_trouble
from fleet.robot_config import Name
from fleet.yaml_model import Duration, Model, wrong

ALL = "all"
"""Pseudo-role for every robot of the run."""
VERBS = ("command", "goto", "path", "plan", "follow", "mission")
"""What a role may do in a step: exactly one of them."""
ACTIONS = ("do", "wait", "wait_for", "ask", "repeat")
"""Kinds of steps: exactly one of them."""
NEVER_REPEATED = frozenset({"arm", "takeoff", "release", "drop", "kill", "disarm", "grip"})
"""Commands that are never retried, because the effect of the first try is unknown."""
REPEATABLE = frozenset({"goto", "path"})
"""Verbs that lead to the same state when repeated."""
FOLLOW_AT = 3.0  # m behind another robot, by default
DEEPEST = 3  # levels of repeats
PercentNumber = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
StepVerb = Literal["command", "goto", "path", "plan", "follow", "mission"]


def _goal(given: Any) -> Any:
    """Refuse a value that is neither the name of a place nor a point."""
    trouble = "" if isinstance(given, str | None) else point_trouble(given)
    if trouble:
        raise ValueError(trouble)
    return given


def _path(given: Any) -> Any:
    """Refuse a value that is no file, no list of points, and no list of these per robot."""
    if isinstance(given, str | None):
        return given
    if not isinstance(given, list) or not 1 <= len(given) <= MOST_POINTS:
        raise ValueError(f"a path is a file, or a list of 1 to {MOST_POINTS} points")
    whole = [each for each in given if not isinstance(each, str)]
    points = whole if all(map(is_point, whole)) else [point for each in whole for point in _points(each)]
    trouble = next((trouble for point in points if (trouble := point_trouble(point))), "")
    if trouble or (points is whole and points and len(whole) < len(given)):
        raise ValueError(trouble or "a list of paths has a file or a list of points for each robot")
    return given


def _points(given: Any) -> list[Any]:
    """Return the points of one of several paths; raises ValueError."""
    if not isinstance(given, list) or is_point(given):
        raise ValueError("a list of paths has a file or a list of points for each robot")
    return given


class _Words(Model):
    """Base of models with keys that are keywords of Python."""

    model_config = ConfigDict(serialize_by_alias=True)


class InputConfig(Model):
    """A value given at the start of the mission; referenced as a whole value by ``{input: NAME}``."""

    type: Literal["number", "integer", "text", "boolean", "place", "robot"] = Field(
        description="Its type: number, integer, text, boolean, place or robot."
    )
    unit: str = Field("", max_length=16, description="Shown to people.")
    default: float | int | str | bool | None = Field(None, description="Left out: it must be given.")
    min: float | None = Field(None, description="Lower bound of a number.")
    max: float | None = Field(None, description="Upper bound of a number.")

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if (self.min is not None or self.max is not None) and self.type not in {"number", "integer"}:
            raise wrong("min" if self.min is not None else "max", "only a number has bounds")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise wrong("min", "is more than max")
        trouble = "" if self.default is None else self.trouble(self.default)
        if trouble:
            raise wrong("default", trouble)
        return self

    def trouble(self, value: Any) -> str:
        """Return why a value is invalid for this input; empty if it is valid."""
        kinds: dict[str, tuple[type, ...]] = {"number": (int, float), "integer": (int,), "boolean": (bool,)}
        allowed = kinds.get(self.type, (str,))
        if not isinstance(value, allowed) or (isinstance(value, bool) and self.type != "boolean"):
            return f"must be {self.type}, not {value!r}"
        if isinstance(value, int | float) and not isinstance(value, bool):
            if isinstance(value, float) and not math.isfinite(value):  # no bound would refuse nan
                return "must be a finite number"
            if self.min is not None and value < self.min:
                return f"must be at least {self.min:g}"
            if self.max is not None and value > self.max:
                return f"must be at most {self.max:g}"
        return ""

    @property
    def sample(self) -> Any:
        """A value of this type, for validation of the mission before the value is known."""
        if self.default is not None:
            return self.default
        if self.type in {"number", "integer"}:
            return next(each for each in (self.min, self.max, 1) if each is not None)
        return False if self.type == "boolean" else "any"


class CountConfig(Model):
    """How many robots fill a role."""

    min: int = Field(1, ge=1, le=1000, description="Fewer: the mission does not start.")
    max: int = Field(1000, ge=1, le=1000, description="More are not used.")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min > self.max:
            raise wrong("min", "is more than max")
        return self


class RoleConfig(_Words):
    """A role in the mission, filled with robots when it starts."""

    from_: Name | None = Field(None, alias="from", description="A group or a robot. Left out: any robot.")
    kind: Name | None = Field(None, description="Only robots of this adapter.")
    can: tuple[str, ...] = Field((), description="Required commands; also goto, path, plan and follow.")
    spares: int = Field(
        0,
        ge=0,
        le=1000,
        description="Number of spare robots that may replace a lost one between two steps. They stay free "
        "for others until then. Only in the outermost mission.",
    )
    count: CountConfig = Field(
        CountConfig(min=1, max=1), description="How many: a number, or {min: 2, max: 4}."
    )


class BatteryConfig(Model):
    """Bounds of a battery's charge in percent."""

    min: PercentNumber | None = Field(None, description="At least.")
    max: PercentNumber | None = Field(None, description="At most.")


class RequireConfig(Model):
    """Requirements of every robot at the start and before each step that moves it."""

    health: Literal["ok", "degraded"] = Field("degraded", description="The worst permitted health.")
    battery: BatteryConfig = Field(BatteryConfig(), description="Percent, as in {min: 60}.")


class ConditionConfig(Model):
    """A condition on the robots of a role: exactly one of battery, health, event."""

    role: Name = Field(description="The role; all: every robot.")
    of: Literal["any", "all"] = Field("any", description="For any or all of its robots.")
    battery: BatteryConfig | None = Field(None, description="Percent, as in {max: 40}.")
    health: Literal["ok", "degraded", "offline", "fault"] | None = Field(None, description="This health.")
    event: str | None = Field(None, min_length=1, description="An event that was reported since the start.")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if sum(each is not None for each in (self.battery, self.health, self.event)) != 1:
            raise wrong("role", "needs exactly one of battery, health and event")
        return self


class WaitForConfig(ConditionConfig):
    """Wait until a condition holds."""

    timeout: Duration = Field(description="Maximum wait, as in 10 min.")
    on_timeout: Literal["continue", "fail"] = Field("fail", description="Reaction to the timeout.")


class AskConfig(Model):
    """A question to a person; the run waits, also through a restart of the edge."""

    text: str = Field(min_length=1, max_length=500, description="The question.")
    timeout: Duration = Field(600.0, description="Maximum wait for the answer.")
    on_timeout: Literal["continue", "abort", "fail"] = Field(
        "abort", description="Reaction to a missing answer."
    )


class ActConfig(_Words):
    """What one role does in a step: exactly one of command, goto, path, plan, follow, mission."""

    command: str | None = Field(None, min_length=1, max_length=64, description="A command of the robot.")
    with_: dict[str, Any] = Field(
        {}, alias="with", description="The data of a command, or the inputs of a mission."
    )
    goto: Annotated[str | list[float] | dict[str, float], BeforeValidator(_goal)] | None = Field(
        None,
        description="A place by its name, [x, y] or [x, y, z] in metres in the site's frame, or {lat, lon, "
        "alt} in degrees and metres above the take-off point.",
    )
    path: Annotated[str | list[Any], BeforeValidator(_path)] | None = Field(
        None,
        description="A list of such points, or a file that has one: YAML, CSV or GeoJSON. A list of files: "
        "one for each robot.",
    )
    plan: str | list[str] | dict[str, Any] | None = Field(
        None, description="A plan file (.plan, or JSON) that the autopilot flies from its memory."
    )
    follow: Name | None = Field(
        None,
        description="A role of one robot: keep behind it until the others have finished the step. The "
        "robot moves straight towards it, at its own height, within its fence and separated "
        "from others.",
    )
    distance: float | None = Field(
        None, ge=0.5, le=100, description="Following distance, m from centre to centre; left out: 3."
    )
    mission: Name | None = Field(
        None,
        description="Another mission of fleet.yaml, as one step: its roles are filled from the robots of "
        "this role. When it fails, they have failed in this step.",
    )
    speed: float | None = Field(None, gt=0, le=100, description="Speed limit, m/s.")
    timeout: Duration | None = Field(
        None, description="Replaces the timeout of the step; progress extends it."
    )
    retry: int = Field(0, ge=0, le=5, description="Retries; only for goto and path.")

    @property
    def verb(self) -> str:
        """The verb that is set."""
        return next(verb for verb in VERBS if getattr(self, verb) is not None)

    @model_validator(mode="after")
    def _one(self) -> Self:
        said = [verb for verb in VERBS if getattr(self, verb) is not None]
        if len(said) != 1:
            raise wrong(said[1] if said else "", f"needs exactly one of {', '.join(VERBS)}")
        if self.with_ and said[0] not in {"command", "mission"}:
            raise wrong("with", "is the data of a command or the inputs of a mission, and there is none")
        if self.timeout is not None and said[0] == "mission":
            raise wrong("timeout", "a mission has a deadline of its own, and its steps have timeouts")
        if self.timeout is not None and said[0] == "follow":
            raise wrong("timeout", "it follows until the others are through: they have timeouts")
        if self.distance is not None and said[0] != "follow":
            raise wrong("distance", "is allowed only with follow")
        if self.speed is not None and said[0] not in REPEATABLE | {"follow"}:
            raise wrong("speed", "is allowed only with goto, path and follow")
        if self.retry and said[0] not in REPEATABLE:
            name = self.command or said[0]
            why = " must not be done twice" if name in NEVER_REPEATED else " is not known to bear it"
            raise wrong("retry", f"is allowed only with goto and path: {name}{why}")
        return self


class RobotFailedConfig(Model):
    """Reaction to a robot that fails in a step."""

    do: str = Field("hold", min_length=1, max_length=64, description="hold, or a command such as land.")
    then: Literal["continue", "wait", "fail"] = Field(
        "continue",
        description="Continue while the quorum holds, ask a person, or end the mission as failed.",
    )


class RepeatConfig(Model):
    """Steps that are executed repeatedly."""

    times: int = Field(ge=1, le=1000, description="Number of rounds; with until: at most.")
    until: ConditionConfig | None = Field(None, description="End when this holds.")
    steps: list[StepConfig] = Field(min_length=1, max_length=100, description="The repeated steps.")


class StepConfig(_Words):
    """One step: exactly one of do, wait, wait_for, ask, repeat."""

    id: Name = Field(description="Its name, unique in the mission.")
    do: dict[Name, ActConfig] | None = Field(None, description="The act of each role; all: every robot.")
    wait: Duration | None = Field(None, description="Wait for a time, as in 30 s.")
    wait_for: WaitForConfig | None = Field(None, description="Wait until a condition holds.")
    ask: AskConfig | None = Field(None, description="Ask a person.")
    repeat: RepeatConfig | None = Field(None, description="Execute steps repeatedly.")
    if_: ConditionConfig | None = Field(
        None, alias="if", description="If it does not hold, the step is skipped."
    )
    start: Literal["together"] | None = Field(
        None, description="together: no robot moves before all are prepared."
    )
    finish: Name = Field(
        "all", description="When the step is over: all, any, or a role; the other robots are then ended."
    )
    timeout: Duration = Field(600.0, description="Timeout of each robot's part; progress extends it.")
    robot_failed: RobotFailedConfig = Field(RobotFailedConfig(), description="Reaction to a failed robot.")
    undo: dict[Name, ActConfig] = Field({}, description="Acts that undo the step, by role.")

    @model_validator(mode="after")
    def _one(self) -> Self:
        said = [action for action in ACTIONS if getattr(self, action) is not None]
        if len(said) != 1:
            raise wrong(said[1] if said else "id", f"a step needs exactly one of {', '.join(ACTIONS)}")
        if self.do is None:
            for key in ("start", "undo"):
                if getattr(self, key):
                    raise wrong(key, "is allowed only in a step with do")
        elif not self.do:
            raise wrong("do", "names no role")
        return self

    @property
    def mission(self) -> tuple[str, ActConfig] | None:
        """The role that executes an inner mission in this step, with its act."""
        return next(((role, act) for role, act in (self.do or {}).items() if act.mission), None)

    @model_validator(mode="after")
    def _mission_alone(self) -> Self:
        if self.mission is None:
            return self
        if len(self.do or {}) > 1:
            raise wrong("do", "a mission is alone in its step: give the other roles steps of their own")
        for key in ("start", "undo", "timeout", "finish"):
            if key in self.model_fields_set:
                raise wrong(key, "is allowed only in the steps of the mission that this step carries out")
        return self


class MissionConfig(Model):
    """A mission: tasks for a fleet."""

    version: Literal[1] = Field(description="The version of this grammar: 1.")
    summary: str = Field("", max_length=200, description="One line for people.")
    inputs: dict[Name, InputConfig] = Field({}, description="Values to be given at the start.")
    roles: dict[Name, RoleConfig] = Field(min_length=1, description="The roles, filled with robots.")
    require: RequireConfig = Field(RequireConfig(), description="Requirements of every robot.")
    occupies: tuple[Name, ...] = Field(
        (), description="Places that it occupies until its end, up to their capacity."
    )
    occupy_within: Duration = Field(
        600.0, description="How long the run waits for these places before it begins; then it fails."
    )
    quorum: dict[Name, int] = Field(
        {}, description="Robots that each role must keep. Left out: the minimum of its count."
    )
    deadline: Duration | None = Field(None, description="The whole run must end by then; nothing extends it.")
    steps: list[StepConfig] = Field(min_length=1, max_length=200, description="The steps, in order.")
    on_failure: Literal["hold", "undo", "stop"] = Field(
        "hold",
        description="hold: its robots hold their position; undo: then the steps are undone in reverse "
        "order; stop: their emergency stop is set, which a person must release.",
    )
    on_abort: str = Field("hold", min_length=1, max_length=64, description="hold, or a command for all.")
    on_restart: Literal["fail", "hold_and_ask", "continue"] = Field(
        "hold_and_ask",
        description="After a restart of the edge. continue: only between steps; in one a person is asked.",
    )
    rehearse: Literal["required"] | None = Field(None, description="required: run refuses without a pass.")
