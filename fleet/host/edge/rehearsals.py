"""Rehearsals of an edge: one at a time, each in its own process; and the stored passes.

Only this process writes a pass, after a rehearsal that it started itself, of its own mission, robots and
configuration: an operator can request a rehearsal, but not report its result. The file has the same access
rights as ``missions.db`` beside it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import secrets
import sys
from asyncio.subprocess import PIPE, STDOUT, Process
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.clock import Clock
from fleet.config.load import Loaded
from fleet.config.missions import Mission
from fleet.config.places import places_of
from fleet.errors import Refused, StateNewer
from fleet.host.edge.rehearsal_task import PlacedRobot, RehearsalLine, RehearsalTask
from fleet.host.workers.worker_task import RobotTask
from fleet.missions.filling import Filling
from fleet.missions.program import Program
from fleet.missions.rehearsal import (
    FRESH,
    Present,
    RehearsalNote,
    RehearsalPoll,
    RehearsalResult,
    RehearsalState,
    StoredPass,
    TrackPoint,
    digest,
    program_digest,
    refusal,
)
from fleet.missions.report import MissionStartRequest
from fleet.model.command import Transport
from fleet.model.geodesy import GeoOrigin
from fleet.model.state import RobotState
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import format_of, refuse_newer
from fleet.spool.state_folder import create_folder
from fleet.version import __version__

log = logging.getLogger(__name__)

PASSES = "rehearsals.json"
FORMAT = 1
KEPT = 100
LARGEST = 1 << 24  # bytes of the longest line
UNHEARD = 15.0  # s without a query after which a rehearsal is ended
POLL_INTERVAL = 1.0  # s
SILENT = 120.0  # s without output after which its process is killed
COMMAND = (sys.executable, "-P", "-m", "fleet.rehearsal")
_encode = msgspec.json.Encoder().encode


class _PassesFile(msgspec.Struct, frozen=True):
    """Content of the file of passes."""

    format: int
    passes: list[StoredPass]


class Rehearsals:
    """Rehearses missions, and decides by their passes which may be started.

    ``states`` returns the present states of the edge's robots.
    """

    def __init__(
        self,
        loaded: Loaded,
        filling: Filling,
        *,
        states: Callable[[], Sequence[RobotState]],
        folder: Path,
        clock: Clock,
    ) -> None:
        self._loaded, self._states = loaded, states
        self._filling = filling
        self._clock = clock
        self._config = config_digest(loaded)
        self._file = folder / PASSES
        self._passes = read_passes(self._file)
        self._now: _RunningRehearsal | None = None
        filling.rehearsed = self.refusal

    def refusal(
        self,
        program: Program,
        roles: dict[str, list[str]] | None,
        places: dict[str, TrackPoint | None],
    ) -> str:
        """Return why a mission may not be started without another rehearsal; empty when it may."""
        present = Present(program, self._config, self._clock.time(), places, roles)
        return refusal(reversed(self._passes), present)

    def configure(self, loaded: Loaded) -> None:
        """Use another configuration; passes of the one before no longer count."""
        self._loaded, self._config = loaded, config_digest(loaded)

    def begin(
        self, question: Query, mission: Mission, program: Program, request: MissionStartRequest
    ) -> None:
        """Start a rehearsal, and answer; on the event loop."""
        try:
            state = self._start_rehearsal(mission, program, request)
        except Refused as error:
            state = RehearsalState(refusal=str(error))
        question.reply(_encode(state))
        question.close()

    def _start_rehearsal(
        self, mission: Mission, program: Program, request: MissionStartRequest
    ) -> RehearsalState:
        """Start a rehearsal; raises Refused."""
        if self._now is not None and not self._now.task.done():
            raise Refused("another rehearsal is under way", hint="wait for its end")
        roles = self._filling.fill(mission, program, request, rehearses=True)
        ours = {robot.name for robot, _ in self._loaded.robots}
        others = sorted({name for names in roles.values() for name in names} - ours)
        if others:
            raise Refused(f"{', '.join(others)}: robots of other edges are not rehearsed")
        states = {state.name: state for state in self._states()}
        config = self._loaded.config
        site = config.site.origin
        task = RehearsalTask(
            mission.name,
            mission.config.model_dump_json(by_alias=True, exclude_unset=True),
            program,
            roles,
            tuple(
                PlacedRobot(_task_of(self._loaded, at), states[robot.name])
                for at, (robot, _) in enumerate(self._loaded.robots)
            ),
            places_of(config.places),
            {name: list(members) for name, members in config.members.items()},
            str(self._loaded.folder.absolute()),
            GeoOrigin(*site) if site else None,
            Transport.BUS.value,
            request.source_type,
            request.session_id,
        )
        places = {name: place_of(states[name]) for names in roles.values() for name in names}
        passed = StoredPass(
            mission.name,
            program_digest(program),
            self._config,
            roles,
            {name: place for name, place in places.items() if place is not None},
            self._clock.time(),
        )
        self._now = _RunningRehearsal(secrets.token_hex(4), task, self._clock, lambda: self._keep(passed))
        return self._now.state(0)

    def answer_state(self, question: Query) -> None:
        """Answer with the state of a rehearsal; on the event loop."""
        try:
            request = decode_json(question.payload, RehearsalPoll)
        except msgspec.DecodeError as error:
            state = RehearsalState(refusal=str(error))
        else:
            known = self._now is not None and self._now.id == request.id
            unknown = RehearsalState(refusal=f"there is no rehearsal {request.id[:40]!a}")
            state = self._now.state(request.since) if self._now is not None and known else unknown
        question.reply(_encode(state))
        question.close()

    async def _keep(self, passed: StoredPass) -> None:
        """Store a pass, on disk for the next process of this edge."""
        self._passes = [*self._passes, passed][-KEPT:]
        try:
            await asyncio.to_thread(_write, self._file, _encode(_PassesFile(FORMAT, self._passes)))
        except OSError as error:
            log.error("a rehearsal that was passed counts until this edge ends: %s", error)  # noqa: TRY400


class _RunningRehearsal:
    """One rehearsal in its process. ``keep`` is called when it has passed."""

    def __init__(
        self, id_: str, task: RehearsalTask, clock: Clock, keep: Callable[[], Coroutine[None, None, None]]
    ) -> None:
        self.id = id_
        self._roles = task.roles
        self._clock = clock
        self._keep = keep
        self._requested = clock.monotonic()
        self._seconds, self._step = 0.0, ""
        self._notes: list[RehearsalNote] = []
        self._result: RehearsalResult | None = None
        self._failure = ""
        self._words = ""
        self._stamp = clock.time()
        self.task = asyncio.get_running_loop().create_task(self._run(_encode(task)), name="rehearsal")

    def state(self, since: int) -> RehearsalState:
        """Return its state; the query also keeps it running."""
        self._requested = self._clock.monotonic()
        notes = tuple(self._notes[since:])
        return RehearsalState(
            self.id, "", self._roles, self._seconds, self._step, notes, self._result, self._failure
        )

    async def _run(self, task: bytes) -> None:
        """Run the process to its end, or until queries for it stop."""
        try:
            process = await asyncio.create_subprocess_exec(
                *COMMAND,
                stdin=PIPE,
                stdout=PIPE,
                stderr=STDOUT,
                limit=LARGEST,
                start_new_session=True,  # Ctrl-C on the terminal goes to the edge, which ends it in order
                env={**os.environ, "PYTHONHASHSEED": "0"},  # reproducible for the same seed
            )
        except OSError as error:
            self._failure = f"its process cannot be started: {error}"
            return
        try:
            assert process.stdin is not None
            process.stdin.write(task + b"\n")
            await self._follow(process)
        except (OSError, ValueError) as error:
            self._failure = f"its process cannot be followed: {error}"
        finally:
            if process.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                await process.wait()

    async def _follow(self, process: Process) -> None:
        """Process the output."""
        assert process.stdout is not None
        reading, heard = asyncio.ensure_future(process.stdout.readline()), self._clock.monotonic()
        while not self._given_up(heard):
            await asyncio.wait({reading}, timeout=POLL_INTERVAL)
            if not reading.done():
                continue
            line, heard = reading.result(), self._clock.monotonic()
            await self._handle_line(line)
            if not line or self._result is not None or self._failure:
                return
            reading = asyncio.ensure_future(process.stdout.readline())
        reading.cancel()

    def _given_up(self, heard: float) -> bool:
        """Return whether it is no longer queried, or its process has been silent since ``heard``."""
        now = self._clock.monotonic()
        if now - self._requested >= UNHEARD:
            self._failure = "its progress is no longer requested"
        elif now - heard >= SILENT:
            self._failure = f"its process said nothing for {SILENT:g} s"
        return bool(self._failure)

    async def _handle_line(self, data: bytes) -> None:
        """Process one line; any other text is an error message of the process."""
        try:
            line = decode_json(data, RehearsalLine)
        except msgspec.DecodeError:
            self._words = data.decode(errors="replace").strip() or self._words
            if not data:
                self._failure = f"its process ended: {self._words or 'it said nothing'}"
            return
        self._seconds, self._step = line.seconds or self._seconds, line.step or self._step
        self._notes += [line.note] if line.note is not None else []
        self._failure = line.failure
        result = line.result
        if result is not None and result.passed:
            await self._keep()
            result = msgspec.structs.replace(result, pass_until=self._stamp + FRESH)
        self._result = result


def place_of(state: RobotState) -> TrackPoint | None:
    """Return a robot's position, in the site's frame, else in its own world; None while unknown."""
    at = state.site or state.position
    return None if at is None else (at.x, at.y, at.z)


def config_digest(loaded: Loaded) -> str:
    """Return a digest of everything in fleet.yaml that a rehearsal depends on, and of this version."""
    config = loaded.config
    places = {name: place.model_dump(mode="json") for name, place in config.places.items()}
    return digest(__version__, dict(loaded.given), config.site.origin, config.members, places)


def _task_of(loaded: Loaded, at: int) -> RobotTask:
    """Return the build description of a robot."""
    config, plugin = loaded.robots[at]
    file = str(plugin.file.absolute()) if plugin.file else ""
    return RobotTask(config.name, plugin.name, file, loaded.given[config.name])


def read_passes(path: Path) -> list[StoredPass]:
    """Return the passes of an earlier process; none if they cannot be read."""
    try:
        data = path.read_bytes()
        if data.startswith(b"["):  # of a fleet before format 1
            return decode_json(data, list[StoredPass])
        refuse_newer(format_of(data), FORMAT)
        return decode_json(data, _PassesFile).passes
    except FileNotFoundError:
        return []
    except (OSError, msgspec.DecodeError, StateNewer) as error:
        log.warning("%s cannot be read: missions must be rehearsed again: %s", path, error)
        return []


def _write(path: Path, data: bytes) -> None:
    """Write the passes atomically, for this user only. Raises OSError."""
    create_folder(path.parent)
    new = path.with_suffix(".new")
    file = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(file, "wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())
    new.replace(path)
