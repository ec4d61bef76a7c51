"""Rules for adding robots to a running edge and removing them; other changes need a restart. Pure."""

from __future__ import annotations

from fleet.config.load import Loaded
from fleet.config.schema import FleetConfig
from fleet.host.process.component_settings import worker_of
from fleet.host.process.stop_inputs import robots_of

AGAIN = "end fleet run and start it again"


def membership_refusal(running: Loaded, new: FleetConfig, added: str) -> str:
    """Return why a robot of the new file cannot be ``added``, or one be removed; empty when it can."""
    if running.config.pair is not None:
        return f"both edges of a pair begin with the same robots: {AGAIN}"
    return _unfit_to_add(running.config, new, added) if added else ""


def groups_blocker(running: FleetConfig, new: FleetConfig) -> str:
    """Return why the groups cannot be changed now: a stop input resolves its robots at the start."""
    before, after = running.members, new.members
    other = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    named = [one.name for one in running.stop_inputs if other.intersection(one.robots)]
    return f"stop input {', '.join(named)} names one that changes: {AGAIN}" if named else ""


def _unfit_to_add(config: FleetConfig, new: FleetConfig, added: str) -> str:
    """Return why a robot cannot be added."""
    twins = {robot.name: robot.twin for robot in new.robots}
    owner = [robot.name for robot in config.robots if robot.twin == twins[added]]
    if owner:
        return f"{owner[0]} has its twin as long as the edge runs: {AGAIN}"
    if config.bus.access and "edge" in config.bus.access.values():
        return f"the access rules of the bus name its twin: {AGAIN}"
    if _stopped_by(new, added) != _stopped_by(config, added):
        return f"a stop input that it needs is opened at the start: {AGAIN}"
    return ""


def _stopped_by(config: FleetConfig, robot: str) -> set[str]:
    """Return the stop inputs that stop a robot."""
    return {one.name for one in config.stop_inputs if robots_of([one], config.members, [robot])}


def runs_in(loaded: Loaded, name: str) -> str:
    """Return the worker of a robot; empty for one of the edge's own process."""
    return next(worker_of(robot, plugin) for robot, plugin in loaded.robots if robot.name == name)
