"""``fleet stop``: the emergency stop from the command line.

Nothing delays it: each edge is reached and stopped on a thread of its own, the edges of this computer before
a fleet file is even opened. Keep the imports of this module light.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Self

import click
import msgspec

from fleet.bus.bus import join_control
from fleet.bus.settings import BusSettings, running_edges, runtime_dirs
from fleet.bus.stop_query import query_stop
from fleet.bus.zenoh_session import ZenohSession
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.client.edges import START, Edges, decoded
from fleet.client.local_user import local_user
from fleet.errors import BusError, NotRunning
from fleet.host.requests.stop_cause import parameters_of
from fleet.supervisor.protocol import StopAnswer
from fleet.supervisor.stop_request import stop_all
from fleet.wire.stop_outcome import DONE, OPEN, SEEN_WITHIN, UNSEEN, stop_outcome

POLL_INTERVAL = 0.2  # s between checks of the progress


class RequestedStop(msgspec.Struct, frozen=True):
    """A stop: the robots (none: all), and the reason; ``request`` identifies it on all routes."""

    names: tuple[str, ...]
    reason: str
    request: str


class StopAttempt:
    """A thread that reaches and stops one edge: the named robots, or all of them.

    ``hit`` has edge and name of the stopped robots, ``problem`` the reason if the edge was not reached.
    """

    def __init__(self, settings: BusSettings, directory: Path, requested: RequestedStop) -> None:
        self.settings = settings
        self.bus_session: ZenohSession | None = None
        self.hit: set[tuple[str, str]] = set()
        self.problem = ""
        self._directory = directory
        # A name with invalid characters must not prevent the stop of the others.
        self._payload = msgspec.json.encode(
            [name.encode(errors="replace").decode() for name in requested.names]
        )
        self._parameters = parameters_of(local_user(), requested.reason, requested.request)
        self._thread = threading.Thread(target=self._stop, name=f"stop:{settings.edge}", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Wait for the end: joining and answering have timeouts."""
        self._thread.join()

    def _stop(self) -> None:
        """Join the bus, and send the stop at once."""
        try:
            self.bus_session = join_control(self.settings, self._directory)
            answers = query_stop(self.bus_session, "*", self._payload, self._parameters)
            for key, names in decoded(answers, list[str]):
                self.hit.update((key.split("/")[1], name) for name in names)
        except BusError as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001 - reported; the other attempts continue
            self.problem = f"{type(error).__name__}: {error}"


class Supervisors:
    """A thread that sends a stop to the supervisors of one runtime folder; works while edges are away."""

    def __init__(self, directory: Path, requested: RequestedStop) -> None:
        self.answers: list[StopAnswer] = []
        self._directory = directory
        self._requested = requested
        self._thread = threading.Thread(target=self._stop, name="stop:supervisors", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Wait for the end: answering has a timeout."""
        self._thread.join()

    def _stop(self) -> None:
        """Send the stop to all supervisors."""
        requested = self._requested
        self.answers = stop_all(
            self._directory, requested.names, why=requested.reason, request=requested.request
        )


class StopAttempts:
    """All attempts to stop some robots, together; as a context manager it closes the sessions."""

    def __init__(self, names: Iterable[str], reason: str = "") -> None:
        plain = tuple(name.rpartition("/")[2] for name in names)
        self._requested = RequestedStop(plain, reason, os.urandom(8).hex())
        self._attempts: list[StopAttempt] = []
        self._supervisors: list[Supervisors] = []
        self.problems: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for attempt in self._attempts:
            if attempt.bus_session is not None:
                attempt.bus_session.close()

    def stop_local_edges(self) -> None:
        """Begin to stop every edge that runs on this computer."""
        for directory in runtime_dirs():
            self._supervisors.append(Supervisors(directory, self._requested))
            for edge in running_edges(directory):
                self._attempts.append(StopAttempt(BusSettings(edge), directory, self._requested))

    def try_file(self, file: str) -> None:
        """Begin to stop the edge of a fleet file, which may have errors."""
        from fleet.cli.outline import outline  # noqa: PLC0415 - only after the first attempts have started

        found = outline(file)
        self.problems += found.problems
        if found.settings.edge or found.settings.connect:
            directories = runtime_dirs() or [Path()]
            self._attempts += [StopAttempt(found.settings, place, self._requested) for place in directories]

    def end(self) -> set[tuple[str, str]]:
        """Wait for all attempts; return edge and name of the stopped robots."""
        for each in self._supervisors:
            each.end()
        for attempt in self._attempts:
            attempt.end()
        hit = {(answer.edge, name) for answer in self._answers if not answer.kept for name in answer.names}
        return hit | self._hit_on_the_bus

    @property
    def _hit_on_the_bus(self) -> set[tuple[str, str]]:
        """The robots stopped over the bus, as edge and name."""
        return {one for attempt in self._attempts for one in attempt.hit}

    def heard(self, edges: Edges) -> set[str]:
        """Return the edges that can send states: joined directly, or answering through a joined edge."""
        return {*edges.joined, *(edge for edge, _ in self._hit_on_the_bus)}

    @property
    def _answers(self) -> list[StopAnswer]:
        """The answers of the supervisors."""
        return [answer for each in self._supervisors for answer in each.answers]

    @property
    def pending(self) -> list[StopAnswer]:
        """The answers for edges that are away, and start with the stop when they are back."""
        return [answer for answer in self._answers if answer.kept]

    @property
    def supervised(self) -> set[str]:
        """The edges that were stopped by their supervisor, also without the bus."""
        return {answer.edge for answer in self._answers if not answer.kept}

    def edges(self) -> Edges:
        """Return the joined edges, with descriptions of the edges that were not reached at all.

        An edge may be tried more than once. If it was reached only by its supervisor, the error of the bus is
        a problem, but the edge is not missing.
        """
        bus_sessions: dict[str, ZenohSession] = {}
        for attempt in self._attempts:
            if attempt.bus_session is not None:
                bus_sessions.setdefault(attempt.settings.edge, attempt.bus_session)
        apart = {
            attempt.settings.edge: f"edge {attempt.settings.edge or '(unknown)'}: {attempt.problem}"
            for attempt in self._attempts
            if attempt.settings.edge not in bus_sessions
        }
        self.problems += [problem for edge, problem in apart.items() if edge in self.supervised]
        return Edges(
            bus_sessions, [problem for edge, problem in apart.items() if edge not in self.supervised]
        )


@click.command()
@click.argument("robots", nargs=-1)
@click.option("--all", "everything", is_flag=True, help="Every robot of every reachable edge.")
@click.option("--reason", default="", help="Reason, shown to the person who releases the robots.")
@reach_option
@with_output
def stop(
    out: Output, robots: tuple[str, ...], *, everything: bool, reason: str, file: str | None
) -> ExitCode:
    """Stop ROBOTS (or groups) at once and keep them stopped.

    This is the emergency stop: aircraft brake and hold in the air, and nothing moves until it is released
    with  fleet release ROBOT.  It asks no question and does not queue. It is sent to every edge that runs on
    this computer, and to the edge of the file as well, even if the file has errors.

    Commands that only make a robot safer still pass. Aircraft: land, return_to_home, and cancellations of
    these or of a take-off (and kill, if its robot permits it). Wheeled robots, dogs, boats and submarines:
    nothing that moves them.

    A robot that is not seen to stand within 8 s, or that sends no state, is NOT SEEN TO STOP.
    """
    if bool(robots) == everything:
        raise click.UsageError("name the robots to stop, or --all")
    with StopAttempts(robots, reason) as effort:
        effort.stop_local_edges()
        if file is not None:
            effort.try_file(file)
        hit = effort.end()
        edges = effort.edges()
        missing = [*edges.unreached, *_missing(edges, robots, hit)]
        if everything:
            missing += [state.name for state in edges.states() if (state.edge, state.name) not in hit]
        failed = _failed(out, edges, hit, effort.heard(edges))
    return _report(out, effort, edges, StopResult(hit, missing, failed))


class StopResult(msgspec.Struct, frozen=True):
    """Result of a stop: ``hit`` are robots whose stop is set, by edge and name.

    ``failed``: those of them that were not seen to stop, and why. ``missing``: descriptions of robots that
    were not reached.
    """

    hit: set[tuple[str, str]]
    missing: list[str]
    failed: Mapping[tuple[str, str], str]


def _failed(
    out: Output, edges: Edges, hit: set[tuple[str, str]], heard: set[str]
) -> dict[tuple[str, str], str]:
    """Wait until the robots of connected edges have stopped; return why some have not."""
    end = time.monotonic() + SEEN_WITHIN
    first: dict[tuple[str, str], float] = {}
    outcomes = _outcomes(edges, hit, first)
    waiting = sorted(name for (_, name), outcome in outcomes.items() if outcome in OPEN)
    if waiting:
        out.note(f"the stop is set; not seen to stand yet: {', '.join(waiting)}")
    # An edge that was reached only by its supervisor sends no states.
    while time.monotonic() < end and any(
        outcome in OPEN and edge in heard for (edge, _), outcome in outcomes.items()
    ):
        time.sleep(POLL_INTERVAL)
        outcomes = _outcomes(edges, hit, first)
    late = f"nothing was seen within {SEEN_WITHIN:g} s"
    inflight = {outcome for outcome in OPEN if outcome != UNSEEN}
    settled = {robot: late if outcome in inflight else outcome for robot, outcome in outcomes.items()}
    return {robot: outcome for robot, outcome in settled.items() if outcome != DONE}


def _outcomes(
    edges: Edges, hit: set[tuple[str, str]], first: dict[tuple[str, str], float]
) -> dict[tuple[str, str], str]:
    """Return the outcomes of the stops; ``first``: the stamp of each robot's first state."""
    outcomes = dict.fromkeys(hit, UNSEEN)
    for state in edges.states():
        robot = (state.edge, state.name)
        if robot in hit:
            outcomes[robot] = stop_outcome(state, first.setdefault(robot, state.stamp))
    return outcomes


def _report(out: Output, effort: StopAttempts, edges: Edges, result: StopResult) -> ExitCode:
    """Report the stopped robots, the others, the reached edges, and errors in the file."""
    problems = effort.problems
    if not edges.joined and not effort.pending and not result.hit:
        advice = f"no edge is running here; {START}"
        raise NotRunning("; ".join([*problems, *(edges.unreached or [advice])]))
    stopped = sorted({name for edge, name in result.hit if (edge, name) not in result.failed})
    kept = {answer.edge: sorted(answer.names) for answer in effort.pending}
    failed = {name: why for (_, name), why in sorted(result.failed.items())}
    reached = sorted({*edges.joined, *effort.supervised})
    document = {"stopped": stopped, "failed": failed, "missing": result.missing, "kept": kept}
    out.data(document | {"edges": reached, "problems": problems})
    for name in stopped:
        out.say(f"{name}: stopped")
    for name, why in failed.items():
        out.say(f"{name}: NOT SEEN TO STOP: {why}")
    for edge, halted in kept.items():
        halted_now = ", ".join(halted) or "none"
        out.say(f"edge {edge} is away: its stop is set when it is back; halted now: {halted_now}")
    if len(result.hit) > 1:
        out.note(f"{len(stopped)} of {len(result.hit)} seen to stop")
    out.note(f"reached: {', '.join(f'edge {edge}' for edge in reached) or 'no edge'}")
    if result.hit:
        out.note("released with: fleet release ROBOT")
    for name in result.missing:
        out.note(f"{name}: NOT STOPPED; fleet ps shows the robots there are")
    for problem in problems:
        out.note(f"{problem} (the stop went out all the same)")
    if not stopped and not kept:
        return ExitCode.REJECTED
    return ExitCode.SOME_FAILED if result.missing or failed else ExitCode.OK


def _missing(edges: Edges, names: tuple[str, ...], hit: set[tuple[str, str]]) -> list[str]:
    """Return the robots and groups that were not completely stopped; ``hit`` were, by edge and name."""
    stopped = {name for pair in hit for name in (pair[1], "/".join(pair))}
    missing = [name for name in names if name not in stopped]
    if not missing:
        return []
    groups = [edge.groups for edge in edges.edges()]
    members = {name: {member for group in groups for member in group.get(name, ())} for name in missing}
    return [name for name in missing if not members[name] or not members[name] <= stopped]
