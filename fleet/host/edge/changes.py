"""Changes of fleet.yaml, applied to the running edge robot by robot; a failed change is undone.

The edge reads its own file again; no configuration comes over the bus. A change that needs a restart is only
reported (``fleet.config.difference``). Docs: docs/adr/0021-changes-of-a-running-edge.md.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query, ZenohSession
from fleet.config.difference import SETTINGS, difference, outline_of, shown_by
from fleet.config.explain import checked
from fleet.config.load import Loaded, load
from fleet.config.loaded_robots import with_configs, with_robot, without_robot
from fleet.config.problems import InvalidConfig
from fleet.errors import FleetError
from fleet.host.edge.last_configuration import LastConfigurationFile
from fleet.host.edge.member_rules import groups_blocker, membership_refusal
from fleet.host.edge.membership import Membership, RobotRegistrations
from fleet.host.edge.shown_configuration import shown_configuration
from fleet.host.edge.stops_during_change import StopsDuringChange
from fleet.host.edge.worker_file_changes import WorkerFileChanges, partly_text, with_outcome
from fleet.host.edge.worker_members import WorkerMembership
from fleet.host.process.rebuild import RESTORED, apply_configuration, hold, rebuild
from fleet.host.process.robot_process import RobotProcess
from fleet.host.process.stop_service import merged_groups, replace_groups
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.rest_check import moving, not_resting
from fleet.host.safety.stricter import is_equally_strict, merge_stricter
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.host.workers.worker_changes import WorkerChanges
from fleet.model.change import (
    FORMAT,
    Change,
    ChangeKind,
    ChangesAnswer,
    ChangesRequest,
    Outcome,
)
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.robot_config import AdapterConfig
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

LIVE = frozenset({ChangeKind.SETTINGS, ChangeKind.REBUILT})
MEMBERS = frozenset({ChangeKind.ADDED, ChangeKind.REMOVED})
LOOSER = "it was rebuilt; what is looser waits until it rests: {}"


class ConfigurationChanges:
    """Running configuration of one edge, and its changes; on the event loop.

    ``configured`` are called with the running configuration after each change. ``blocker`` returns why a
    section cannot be changed now. ``groups`` are used by stops, from any thread.
    """

    def __init__(
        self,
        loaded: Loaded,
        process: RobotProcess,
        remote: Mapping[str, RemoteRobot],
        workers: WorkerChanges,
        *,
        folder: Path,
        configured: Iterable[Callable[[Loaded], None]],
        blocker: Callable[[str], str],
        followers: RobotRegistrations,
        members: WorkerMembership,
        groups: dict[str, list[str]],
    ) -> None:
        self._running = loaded
        self._process, self._remote, self._workers = process, remote, workers
        self._file, self._configured = LastConfigurationFile(folder, process.clock), tuple(configured)
        self._section_blocker = blocker
        self._stops = StopsDuringChange(process)
        self._membership = Membership(process, followers, self._stops, members)
        self._registrations, self._groups = followers, groups
        self._wider: Mapping[str, Iterable[str]] = {}  # groups of a new file that is not applied yet
        self._worker_changes = WorkerFileChanges(workers, remote)
        self._under_way: asyncio.Task[None] | None = None

    def declare(self, control: ZenohSession) -> None:
        """Serve requests on the bus; its thread passes them to the loop."""
        loop = self._process.loop

        def requested(question: Query) -> None:
            loop.call_soon_threadsafe(self._begin, question)

        control.declare_queryable(keys.changes(self._process.edge), requested)

    async def begin(self) -> None:
        """Write the running configuration to disk."""
        await self._file.write(self._running)

    async def close(self) -> None:
        """Cancel a change in progress: the edge ends, and its next start reads the file."""
        if self._under_way is not None:
            self._under_way.cancel()
            await asyncio.wait({self._under_way})

    def _begin(self, question: Query) -> None:
        """Answer one query at a time."""
        if self._under_way is not None and not self._under_way.done():
            _answer(question, ChangesAnswer(refusal="another change is under way; wait for its end"))
        else:
            self._under_way = asyncio.create_task(self._carry_out(question), name="changes")

    async def _carry_out(self, question: Query) -> None:
        """Execute a request, and answer."""
        try:
            requested = decode_json(question.payload, ChangesRequest)
            answer = await self._answer_to(requested)
            if requested.text:
                text = await asyncio.to_thread(shown_configuration, self._running.file)
                answer = msgspec.structs.replace(answer, text=text)
        except msgspec.DecodeError as error:
            answer = ChangesAnswer(refusal=f"what is asked cannot be read: {error}")
        except Exception as error:  # the sender waits, and the edge must go on
            log.exception("a change of the configuration failed")
            answer = ChangesAnswer(refusal=f"the change failed: {type(error).__name__}: {error}")
        _answer(question, answer)

    async def _answer_to(self, requested: ChangesRequest) -> ChangesAnswer:
        """Return the differences, and with ``apply`` the outcome of each."""
        if requested.format > FORMAT:
            return ChangesAnswer(
                refusal=f"this edge reads format {FORMAT} of it, not {requested.format}: update it"
            )
        file = str(self._running.file.resolve())
        if requested.file not in {"", file}:
            return ChangesAnswer((), file, f"this edge reads {file}, not {requested.file}")
        try:
            new = await asyncio.to_thread(load, self._running.file)
        except InvalidConfig as error:
            problems = tuple(map(str, error.problems))
            return ChangesAnswer((), file, f"{file} cannot be used; nothing was changed", problems)
        except FleetError as error:
            return ChangesAnswer((), file, f"{file} cannot be used; nothing was changed: {error}")
        found = await asyncio.to_thread(_found, self._running, new)
        if requested.do == "diff":
            planned = (
                msgspec.structs.replace(each, why=each.why or self._blocker(each, new)) for each in found
            )
            return ChangesAnswer(tuple(planned), file, warnings=tuple(map(str, new.warnings)))
        changes = await self._apply(found, new, requested)
        await self._file.write(self._running)
        return ChangesAnswer(changes, file)

    # -- dry run ---------------------------------------------------------------------------------------

    def _blocker(self, change: Change, new: Loaded) -> str:
        """Return why a robot or a section cannot be changed now; empty when it can."""
        if change.kind in MEMBERS:
            return self._member_blocker(change, new, force=False)
        if change.kind not in LIVE:
            return ""
        if change.section:
            groups = groups_blocker(self._running.config, new.config) if change.name == "groups" else ""
            return groups or self._section_blocker(change.name)
        here = self._process.robots.get(change.name)
        if here is not None:
            return not_resting(here)
        return self._workers.blocker(self._remote[change.name].worker)

    def _member_blocker(self, change: Change, new: Loaded, *, force: bool) -> str:
        """Return why a robot cannot be added or removed now; empty when it can."""
        name, added = change.name, change.kind is ChangeKind.ADDED
        why = membership_refusal(self._running, new.config, name if added else "")
        if why or added or force:
            return why
        runs = ", ".join(self._registrations.runs_with(name))
        return self._membership.blocker(name) or (runs and f"{name} is in run {runs}")

    # -- application -----------------------------------------------------------------------------------

    async def _apply(
        self, found: Iterable[Change], new: Loaded, requested: ChangesRequest
    ) -> tuple[Change, ...]:
        """Apply the changes, one robot or worker after the other."""
        await self._widen(new.config.members)
        self._stops.begin(self._groups)
        try:
            return await self._carried_out(found, new, requested)
        finally:
            self._stops.end()

    async def _carried_out(
        self, found: Iterable[Change], new: Loaded, requested: ChangesRequest
    ) -> tuple[Change, ...]:
        """Apply the changes, and record them."""
        found = sorted(found, key=lambda change: change.kind is not ChangeKind.REMOVED)  # twins become free
        done: list[Change] = []
        sections: list[Change] = []
        by_worker: dict[str, list[Change]] = {}
        for change in found:
            await asyncio.sleep(0)  # a thousand robots must not delay a stop
            if change.kind in MEMBERS:
                done.append(await self._member(change, new, requested))
            elif change.kind not in LIVE:
                done.append(_left(change))
            elif change.section:
                sections.append(change)
            elif change.name in self._process.robots:
                done.append(await self._changed(change, new, requested))
            else:
                by_worker.setdefault(self._remote[change.name].worker, []).append(change)
        for worker, changes in by_worker.items():
            after, ends = await self._worker_changes.carry_out(
                worker, changes, self._running, new, force=requested.force
            )
            done += ends
            if after is not self._running:
                self._running = after
                self._publish()
        missing = sorted(_names_of(new) ^ _names_of(self._running))
        done += await self._apply_sections(sections, new, missing)
        for change in done:
            _record(self._process, change, requested)
        return tuple(done)

    async def _member(self, change: Change, new: Loaded, requested: ChangesRequest) -> Change:
        """Add or remove a robot."""
        if why := self._member_blocker(change, new, force=requested.force):
            return with_outcome(change, Outcome.REFUSED, why)
        name, added = change.name, change.kind is ChangeKind.ADDED
        try:
            if added:
                trouble = await self._membership.add(name, self._running, new)
            else:
                trouble = await self._membership.remove(name, self._running, force=requested.force)
        except Exception as error:
            log.exception("the change of %s failed", name)
            trouble = f"{type(error).__name__}: {error}"
        if trouble:
            return with_outcome(change, Outcome.FAILED, trouble)
        running = self._running
        self._running = with_robot(running, new, name) if added else without_robot(running, name)
        self._publish()
        return with_outcome(change, Outcome.DONE)

    async def _apply_sections(self, changes: list[Change], new: Loaded, missing: list[str]) -> list[Change]:
        """Apply sections, all or none: they refer to each other, and to robots (none of the ``missing``)."""
        if changes and missing:
            why = f"they may refer to {', '.join(missing)}: see their errors, and apply again"
            return [with_outcome(change, Outcome.REFUSED, why) for change in changes]
        why = "; ".join(filter(None, (self._blocker(change, new) for change in changes)))
        regroups = any(change.name == "groups" for change in changes)
        if regroups and not why and (why := await self._workers.regroup(new.config.members)):
            await self._workers.regroup(self._groups)
        if why:
            return [with_outcome(change, Outcome.REFUSED, why) for change in changes]
        if changes:
            taken = {change.name: getattr(new.config, change.name) for change in changes}
            config = self._running.config.model_copy(update=taken)
            self._wider = {} if regroups else self._wider
            missions = new.missions if "missions" in taken else self._running.missions
            self._running = msgspec.structs.replace(self._running, config=config, missions=missions)
            self._publish()
        if regroups:
            self._workers.all_run_with(self._running)
        return [with_outcome(change, Outcome.DONE) for change in changes]

    async def _changed(self, change: Change, new: Loaded, requested: ChangesRequest) -> Change:
        """Change a robot of this process; a failure does not keep the others from their changes."""
        try:
            return await self._here(change, new, requested)
        except Exception as error:
            log.exception("the change of %s failed", change.name)
            return with_outcome(change, Outcome.FAILED, f"{type(error).__name__}: {error}")

    async def _here(self, change: Change, new: Loaded, requested: ChangesRequest) -> Change:
        """Change a robot of this process."""
        robot = self._process.robots[change.name]
        try:
            config = own_config(robot, new)
        except Exception as error:  # noqa: BLE001 - the validators are the adapter's own code
            return with_outcome(change, Outcome.FAILED, f"its adapter, as it is loaded, refuses it: {error}")
        live, moves = change.kind is ChangeKind.SETTINGS, moving(robot)
        blocker = moves if requested.force else not_resting(robot)
        if blocker and (live or not requested.force):
            return self._stricter(robot, config, new, change, blocker)
        can, wanted = robot.controller.can, config
        if moves:  # the rebuild stops it; looser settings wait until its standstill is confirmed
            config = merge_stricter(robot.config, config, limits=can.limits, separation=can.separation)
        trouble = apply_configuration(robot, config) if live else await rebuild(self._process, robot, config)
        if trouble:
            return with_outcome(change, Outcome.FAILED, f"{trouble}; {RESTORED}")
        known = {field: getattr(config, field) for field in SETTINGS} if moves else {}
        running = _config_of(new, change.name).model_copy(update=known)
        self._runs_with({change.name: running}, {change.name: new.given[change.name]})
        if moves and not is_equally_strict(config, wanted, can.limits, can.separation):
            return with_outcome(change, Outcome.PARTLY, LOOSER.format(moves))
        return with_outcome(change, Outcome.DONE)

    def _stricter(
        self, robot: LocalRobot, config: AdapterConfig, new: Loaded, change: Change, moving: str
    ) -> Change:
        """Restrict a robot that is not at rest to the stricter parts of its new configuration."""
        name = robot.name
        held = hold(robot, config, whole=change.kind is ChangeKind.SETTINGS)
        if held.trouble:
            return with_outcome(change, Outcome.FAILED, f"{held.trouble}; {RESTORED}")
        if held.complete:
            self._runs_with({name: _config_of(new, name)}, {name: new.given[name]})
            return with_outcome(change, Outcome.DONE)
        if not held.changed:
            return with_outcome(change, Outcome.REFUSED, moving)
        known = {field: getattr(held.config, field) for field in SETTINGS}
        self._runs_with({name: _config_of(self._running, name).model_copy(update=known)}, {})
        return with_outcome(change, Outcome.PARTLY, partly_text(moving))

    def _runs_with(self, configs: Mapping[str, AdapterConfig], given: Mapping[str, str]) -> None:
        """Record changed configurations as running."""
        self._running = with_configs(self._running, configs, given)
        self._publish()

    def _publish(self) -> None:
        """Pass on the running configuration."""
        for configured in self._configured:
            configured(self._running)
        replace_groups(self._groups, merged_groups(self._running.config.members, self._wider))

    async def _widen(self, wider: Mapping[str, Iterable[str]]) -> None:
        """Make stops of groups also reach the members in a new file, until that is applied."""
        members = self._running.config.members
        self._wider = wider if wider != members else {}
        groups = merged_groups(members, self._wider)
        if groups == self._groups:
            return
        replace_groups(self._groups, groups)
        if silent := await self._workers.regroup(groups):
            log.warning("%s: stops of its new groups reach it by the edge", silent)


def _record(process: RobotProcess, change: Change, requested: ChangesRequest) -> None:
    """Write the outcome of a change into the history."""
    if change.kind is ChangeKind.UNTOUCHED:
        return
    severity = Severity.WARNING if change.outcome in {Outcome.FAILED, Outcome.REFUSED} else Severity.INFO
    text = f"fleet apply: {change.name} {change.kind.value}: {change.outcome.value}"
    text += f": {change.why}" if change.why else ""
    log.info("%s", text)
    requester = Requester(Transport.BUS, requested.by)
    robot = "" if change.section else change.name
    event = EventReport(process.clock.time(), EventKind.COMMAND, text, severity, requester, "apply")
    process.history.add(robot, event)


def _found(running: Loaded, new: Loaded) -> tuple[Change, ...]:
    """Return the differences; this takes a third of a second with a thousand robots."""
    return difference(outline_of(running), outline_of(new), shown_by(running.secrets | new.secrets))


def own_config(robot: LocalRobot, loaded: Loaded) -> AdapterConfig:
    """Return a robot's configuration as its adapter's own Config; raises its validation errors."""
    given = msgspec.json.decode(loaded.given[robot.name])
    return checked(robot.plugin.Config, given, {"folder": loaded.folder})


def _names_of(loaded: Loaded) -> set[str]:
    """Return the names of the robots."""
    return {robot.name for robot, _ in loaded.robots}


def _config_of(loaded: Loaded, name: str) -> AdapterConfig:
    """Return the configuration of a robot."""
    return next(robot for robot, _ in loaded.robots if robot.name == name)


def _left(change: Change) -> Change:
    """Return a change that cannot be applied while the edge runs, as refused."""
    if change.kind is ChangeKind.UNTOUCHED:
        return change
    return with_outcome(change, Outcome.REFUSED, f"{change.why}: end fleet run and start it again")


def _answer(question: Query, answer: ChangesAnswer) -> None:
    question.reply(msgspec.json.encode(answer))
    question.close()
