"""Common form of both kinds of adapter, Adapter and FrameAdapter, for the rest of the host."""

from __future__ import annotations

import difflib
import functools
import logging
from collections.abc import Mapping
from typing import Any

import msgspec

from fleet.adapter import Adapter, FrameAdapter, Robot
from fleet.commands import CommandSpec, arguments
from fleet.host.robot.frame_adapter_runner import FrameAdapterRunner
from fleet.missions.plan import plans_of
from fleet.model.body import BodyPart
from fleet.model.command import Command
from fleet.model.geometry import Vector3, Velocity
from fleet.model.navigation import AnyTask, FlyMission, FollowRobot
from fleet.robot_config import AdapterConfig, Limits, Separation
from fleet.runtime.exception_barrier import call_guarded
from fleet.wire.verbs import VERBS, Verb

log = logging.getLogger(__name__)

AdapterClass = type[Adapter[Any]] | type[FrameAdapter[Any]]
_NOISE = 0.01  # m/s; below it a velocity component is rounding noise


class Capabilities(msgspec.Struct, frozen=True):
    """Capabilities that a kind of robot declares; the host refuses everything else.

    ``lacking`` maps a declared name that this robot does not have to the reason. Its adapter may change it.
    """

    commands: Mapping[str, CommandSpec]
    drives: bool
    navigates: bool
    limits: Limits
    separation: Separation = Adapter.separation
    holonomic: bool = False
    combines_keys: bool = False
    moves_joints: bool = False
    lacking: dict[str, str] = {}
    plans: frozenset[str] = frozenset()  # kinds of vehicle whose plans it accepts; empty: any
    body: tuple[BodyPart, ...] = ()  # for drawings

    def command(self, name: str) -> CommandSpec | None:
        """Return a declared command, None for one that this robot does not have."""
        return None if name in self.lacking else self.commands.get(name)

    def refusal(self, velocity: Velocity) -> str | None:
        """Return why the robot cannot move like this at all; None when it can."""
        if not self.drives:
            return "it takes no velocities"
        if not self.holonomic and abs(velocity.linear.y) > _NOISE:
            return "it does not move sideways"
        if self.limits.vertical_speed is None and abs(velocity.linear.z) > _NOISE:
            return "it stays on the ground"
        if not self.lacking or VERBS.keys().isdisjoint(self.lacking):
            return None
        return self._lacked(velocity)

    def _lacked(self, velocity: Velocity) -> str | None:
        """Return why this robot lacks a direction of the velocity; None when it lacks none."""
        linear = velocity.linear
        along = {"x": linear.x, "y": linear.y, "z": linear.z, "yaw": velocity.yaw_rate}
        for name, verb in VERBS.items():
            if verb.sign * along[verb.axis] > _NOISE and name in self.lacking:
                return self.lacking[name]
        return None

    @property
    def verbs(self) -> tuple[str, ...]:
        """The motion verbs along which the robot can move."""
        return tuple(name for name, verb in VERBS.items() if self.refusal(_along(verb)) is None)

    @property
    def is_holonomic(self) -> bool:
        """True for a robot that moves sideways; its kind does, and it does not lack the verbs."""
        return self.holonomic and self.lacking.keys().isdisjoint(("strafe_left", "strafe_right"))

    @property
    def joint_refusal(self) -> str | None:
        """Why the robot takes no joint targets at all; None when it takes some."""
        return None if self.moves_joints else "it takes no joint targets"

    def cannot(self, task: AnyTask) -> str | None:
        """Return why the robot cannot execute such a task at all; None when it can."""
        if isinstance(task, FlyMission) and not self.navigates:
            return "it carries out no missions: it has no autopilot with a memory for them; send it goals"
        if isinstance(task, FollowRobot) and not self.drives:
            return "it takes no velocities, so that it cannot be led after another robot"
        return self.lacking.get("plan" if isinstance(task, FlyMission) else "goto")

    def on(self, autopilot: str, vehicle: str) -> Capabilities:
        """Return these with the plans for the reported vehicle; plans for other kinds are then refused."""
        return msgspec.structs.replace(self, plans=plans_of(self.plans, autopilot, vehicle))

    @property
    def moves(self) -> bool:
        """True if any declared capability may move the robot."""
        streamed = self.drives or self.moves_joints
        return streamed or self.navigates or any(spec.moves for spec in self.commands.values())

    def hint(self, name: str) -> str:
        """Return why the robot lacks a command, or the closest match to an undeclared name.

        The motion verbs are among the names: they are sent as commands too, and executed as velocities.
        """
        if name in self.lacking:
            return self.lacking[name]
        names = sorted({*self.commands, *self.verbs})
        near = difflib.get_close_matches(name, names, n=1)
        if near:
            return f"did you mean {near[0]!r}?"
        return f"it takes {', '.join(names) or 'no commands'}"


def _along(verb: Verb) -> Velocity:
    """Return a velocity along a verb."""
    parts = {verb.axis: float(verb.sign)}
    return Velocity(
        Vector3(parts.get("x", 0.0), parts.get("y", 0.0), parts.get("z", 0.0)), parts.get("yaw", 0.0)
    )


def configured(can: Capabilities, config: AdapterConfig) -> Capabilities:
    """Return one robot's capabilities: with its own command timeouts, plans and body."""
    commands = {
        name: spec
        if (limit := config.timeout_of(name)) is None
        else msgspec.structs.replace(spec, timeout=limit)
        for name, spec in can.commands.items()
    }
    return msgspec.structs.replace(
        can, commands=commands, lacking={}, plans=config.plans(), body=_body_of(config)
    )


def _body_of(config: AdapterConfig) -> tuple[BodyPart, ...]:
    """Return the parts of a robot's body for drawings; none, with a warning, if they cannot be computed."""
    try:
        return call_guarded(config.body_parts)
    except Exception as error:  # noqa: BLE001 - a robot runs without its drawing
        log.warning("%s cannot be drawn: %s", config.name, error)
        return ()


@functools.lru_cache(maxsize=64)  # a thousand robots of one kind share it
def capabilities(plugin: AdapterClass) -> Capabilities:
    """Return the capabilities that the class declares."""
    if issubclass(plugin, FrameAdapter):
        moves_joints = plugin.joint_ranges is not FrameAdapter.joint_ranges
    else:
        moves_joints = plugin.moves_joints()
    return Capabilities(
        plugin.commands(),
        plugin.drives(),
        issubclass(plugin, Adapter) and plugin.navigates(),
        plugin.limits,
        plugin.separation,
        plugin.holonomic,
        plugin.combines_keys,
        moves_joints,
    )


def create_adapter(plugin: AdapterClass, config: AdapterConfig, robot: Robot) -> Adapter[Any]:
    """Return a new adapter for one attempt to run a robot.

    Raises LinkRefused or Fault for a FrameAdapter whose link or halt is unusable.
    """
    if issubclass(plugin, FrameAdapter):
        return FrameAdapterRunner(plugin(config), robot)
    return plugin(config, robot)


def start_command(adapter: Adapter[Any], spec: CommandSpec, command: Command) -> Any:
    """Start a command: an async iterator of Progress when ``spec.streams``, else a coroutine.

    Raises Refused for data that the command does not take.
    """
    if type(adapter) is FrameAdapterRunner:  # not isinstance: a check against an abstract class is slow
        return adapter.perform(spec, command)
    return getattr(adapter, spec.method)(**arguments(spec, command.data))
