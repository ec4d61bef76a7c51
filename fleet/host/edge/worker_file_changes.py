"""Changes of robots in workers: stricter settings at once, the rest by a restart of the worker."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from fleet.config.load import Loaded
from fleet.config.loaded_robots import with_configs, with_settings
from fleet.host.safety.stricter import may_loosen
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_changes import WorkerChanges
from fleet.model.change import Change, ChangeKind, HeldRobot, HoldRobot, Outcome


class WorkerFileChanges:
    """Changes of one edge's robots in workers; on the event loop."""

    def __init__(self, workers: WorkerChanges, remote: Mapping[str, RemoteRobot]) -> None:
        self._workers, self._remote = workers, remote

    async def carry_out(
        self, worker: str, changes: Iterable[Change], running: Loaded, new: Loaded, *, force: bool
    ) -> tuple[Loaded, list[Change]]:
        """Change the robots of a worker; return the running configuration afterwards, and the outcomes.

        Looser settings ignore ``force``: only the worker knows now whether its robots are at rest.
        """
        changes = list(changes)
        names = [change.name for change in changes]
        configs = {robot.name: robot for robot, _ in new.robots if robot.name in names}
        looser = [
            robot.name
            for robot, _ in running.robots
            if robot.name in configs and may_loosen(robot, configs[robot.name])
        ]
        after = with_configs(running, configs, {name: new.given[name] for name in names})
        held = await self._workers.hold(worker, {change.name: _wanted(change, new) for change in changes})
        if all(name in held and held[name].complete for name in names):
            self._workers.runs_with(worker, after)
            outcome, why = Outcome.DONE, ""
        else:
            outcome, why = await self._workers.change(worker, after, force=force and not looser)
        if outcome is Outcome.REFUSED:
            why += f"; what holds {', '.join(looser)} back is not loosened in motion" * bool(force and looser)
            return self._held(worker, changes, held, running, new, why)
        if outcome is Outcome.FAILED:
            return running, [with_outcome(change, outcome, why) for change in changes]
        for name, config in configs.items():
            self._remote[name].configure(config)
        return after, [with_outcome(change, outcome, why) for change in changes]

    def _held(  # noqa: PLR0917 - by position
        self,
        worker: str,
        changes: Iterable[Change],
        held: Mapping[str, HeldRobot],
        running: Loaded,
        new: Loaded,
        why: str,
    ) -> tuple[Loaded, list[Change]]:
        """Return configuration and outcomes when the worker goes on with parts of the changes."""
        ends, after = [], running
        for change in changes:
            one = held.get(change.name, HeldRobot())
            outcome, reason = _outcome(one, why)
            ends.append(with_outcome(change, outcome, reason))
            if outcome is Outcome.REFUSED:
                continue
            if one.complete:
                config = next(robot for robot, _ in new.robots if robot.name == change.name)
                given = new.given[change.name]
            else:
                config, given = with_settings(running, change.name, one.settings)
            after = with_configs(after, {change.name: config}, {change.name: given})
            self._remote[change.name].configure(config)
        if after is not running:
            self._workers.runs_with(worker, after)
        return after, ends


def _wanted(change: Change, new: Loaded) -> HoldRobot:
    """Return the request to restrict a robot."""
    return HoldRobot(new.given[change.name], whole=change.kind is ChangeKind.SETTINGS)


def _outcome(held: HeldRobot, why: str) -> tuple[Outcome, str]:
    """Return the outcome of a change whose worker goes on, because of ``why``."""
    if held.complete:
        return Outcome.DONE, ""
    if held.changed:
        return Outcome.PARTLY, partly_text(why)
    return Outcome.REFUSED, f"{why}; {held.why}" if held.why else why


def partly_text(why: str) -> str:
    """Return the text for a robot to which a change applies in part."""
    return f"what is stricter holds from now on; the rest waits until it rests: {why}"


def with_outcome(change: Change, outcome: Outcome, why: str = "") -> Change:
    """Return a change with its outcome."""
    return msgspec.structs.replace(change, outcome=outcome, why=why)
