"""``fleet mission``: start, follow and control missions."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import click
import msgspec

from fleet.cli.completion import ROBOT
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, show_error, with_output
from fleet.cli.rehearsals import follow_rehearsal
from fleet.cli.runs import follow, run_lines
from fleet.cli.send import parse_argument
from fleet.client import mission_requests
from fleet.client.edges import Edges
from fleet.client.local_user import local_user
from fleet.client.missions import (
    LOOK,
    PLAN_FILES,
    edge_of,
    find_run,
    known_mission,
    mission_named,
    plan_mission,
    start_mission,
)
from fleet.errors import Refused
from fleet.missions.report import MissionStartRequest, RunControlRequest
from fleet.missions.words import log_line


@click.group()
def mission() -> None:
    """Start, follow and control missions of one or several robots.

    Before a run: ls, show, check, rehearse. Then run. During it: ps, pause, resume, answer, abort; fleet take
    takes one robot out of it, fleet stop stops robots whatever they do. Afterwards: log, results.

    RUN is the id that run and ps show, or its beginning. Left out, it is the only run in progress; for log
    and results the newest.
    """


@mission.command("ls")
@reach_option
@with_output
def ls(out: Output, *, file: str | None) -> ExitCode:
    """List the missions of the running edges."""
    with Edges.reach(file) as edges:
        found = mission_requests.missions(edges, "*")
    out.data({"missions": [msgspec.to_builtins(each) for each in found]})
    out.table(
        ["mission", "edge", "roles", "summary"],
        [[each.name, each.edge, ", ".join(each.roles), each.summary] for each in found],
    )
    return ExitCode.OK


@mission.command("show")
@click.argument("name")
@reach_option
@with_output
def show(out: Output, name: str, *, file: str | None) -> ExitCode:
    """Show the inputs, roles and steps of a mission."""
    with Edges.reach(file) as edges:
        found = known_mission(edges, name)
    out.data(msgspec.to_builtins(found))
    out.say(f"{found.name} on {found.edge}" + (f": {found.summary}" if found.summary else ""))
    for title, pairs in (("inputs", found.inputs), ("roles", found.roles)):
        for key, words in pairs.items():
            out.say(f"  {title[:-1]} {key}: {words}")
    for number, step in enumerate(found.steps, 1):
        out.say(f"  {number}. {step}")
    return ExitCode.OK


@mission.command("check")
@click.argument("path", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path))
@with_output
def check(out: Output, path: Path) -> ExitCode:
    """Check a mission file, or a plan, and report every error in it, with line and column.

    Robots, groups, places and commands are not known here: missions in fleet.yaml are checked against them by
    fleet check, and any mission when it is started. Exit code 3 for an error.
    """
    from fleet.config.missions import KnownNames, read_mission  # noqa: PLC0415 - pydantic is slow to import
    from fleet.config.problems import InvalidConfig  # noqa: PLC0415

    if path.suffix in PLAN_FILES:
        return _check_plan(out, path)
    try:
        found = read_mission(path, os.environ, KnownNames())
    except InvalidConfig as error:
        problems = [msgspec.to_builtins(problem) for problem in error.problems]
        out.data({"ok": False, "file": str(path), "problems": problems})
        if not out.as_json:
            show_error(error)
        return ExitCode.CONFIG_INVALID
    out.data({"ok": True, "file": str(path), "problems": []})
    roles = ", ".join(found.config.roles)
    out.say(f"{path} is valid: {len(found.config.steps)} steps, roles {roles}")
    return ExitCode.OK


def _check_plan(out: Output, path: Path) -> ExitCode:
    """Check a plan file and report its error."""
    try:
        plan_mission(path)
    except Refused as error:
        out.data({"ok": False, "file": str(path), "problems": [{"message": error.reason}]})
        if not out.as_json:
            show_error(error)
        return ExitCode.CONFIG_INVALID
    out.data({"ok": True, "file": str(path), "problems": []})
    out.say(f"{path} is valid; fly it with: fleet mission run {path} --robot NAME")
    return ExitCode.OK


@mission.command("run")
@click.argument("what", metavar="MISSION")
@click.argument("inputs", nargs=-1, metavar="[INPUT=VALUE]...")
@click.option("--robot", "robots", multiple=True, type=ROBOT, help="[ROLE=]ROBOT: a robot for a role.")
@click.option("--detach", is_flag=True, help="Start it without following it.")
@reach_option
@with_output
def run(
    out: Output,
    what: str,
    inputs: tuple[str, ...],
    *,
    robots: tuple[str, ...],
    detach: bool,
    file: str | None,
) -> ExitCode:
    """Start a mission and follow it to its end.

    MISSION is one of fleet.yaml, a mission file (.yaml), or a plan that one aircraft flies from its memory
    (.plan of QGroundControl, or JSON). Ctrl-C leaves the mission running. Exit code 0: completed, 7: with
    losses, 8: ended otherwise, 9: unknown.

    For example:  fleet mission run survey.plan --robot kestrel
    """
    given = dict(parse_argument(each) for each in inputs)
    _require_a_pilot(what, robots)

    def show(roles: Mapping[str, Sequence[str]]) -> None:
        for role, names in roles.items():
            out.note(f"{role}: {', '.join(names)}")

    with Edges.reach(file) as edges:
        started = start_mission(edges, what, inputs=given, robots=_chosen(robots, what), filled=show)
        out.note(f"run {started.id} of {mission_named(what)[0]} started")
        if detach:
            out.data({"run": started.id, "roles": started.roles})
            return ExitCode.OK
        return follow(out, started)


@mission.command("rehearse")
@click.argument("what", metavar="MISSION")
@click.argument("inputs", nargs=-1, metavar="[INPUT=VALUE]...")
@click.option("--robot", "robots", multiple=True, type=ROBOT, help="[ROLE=]ROBOT: a robot for a role.")
@reach_option
@with_output
def rehearse(
    out: Output, what: str, inputs: tuple[str, ...], *, robots: tuple[str, ...], file: str | None
) -> ExitCode:
    """Execute a mission with simulated robots, from the robots' present positions, and show the result.

    No robot moves: the edge does it in a separate process, faster than real time. MISSION and the exit codes
    are those of run. A mission with rehearse: required can be started for an hour after a successful
    rehearsal.
    """
    _require_a_pilot(what, robots)
    name, sent = mission_named(what)
    with Edges.reach(file) as edges:
        chosen = _chosen(robots, what)
        given = dict(parse_argument(each) for each in inputs)
        request = MissionStartRequest(mission=sent, inputs=given, robots=chosen, session_id=local_user())
        again = " ".join(["fleet mission run", what, *inputs, *(f"--robot {robot}" for robot in robots)])
        return follow_rehearsal(out, edges, edge_of(edges, name, chosen, sent), name, request, again)


@mission.command("ps")
@click.option("-a", "--all", "ended", is_flag=True, help="Also runs that have ended.")
@reach_option
@with_output
def ps(out: Output, *, ended: bool, file: str | None) -> ExitCode:
    """Show the runs in progress, with the past and present acts of each of their robots.

    On a terminal it follows them until they have ended, or until Ctrl-C, which does not end them.
    """
    with Edges.reach(file) as edges:
        while True:
            found = [each for each in mission_requests.runs(edges, "*") if ended or not each.outcome]
            if out.as_json or out.height is None or not any(not each.outcome for each in found):
                break
            out.screen(run_lines(found, out.width))
            time.sleep(LOOK)
    out.data({"runs": [msgspec.to_builtins(each) for each in found]})
    out.lines(run_lines(found, out.width))
    return ExitCode.OK


def _control(name: str, summary: str) -> None:
    """Add a command that controls a run."""

    @mission.command(name, help=summary)
    @click.argument("run", required=False, default="")
    @reach_option
    @with_output
    def control(out: Output, run: str, *, file: str | None) -> ExitCode:
        return _controlled(out, file, run, lambda who: RunControlRequest(name, session_id=who))  # type: ignore[arg-type]


_control("pause", "Pause RUN: its robots hold their positions until resume; its deadline continues.")
_control("resume", "Resume RUN; if something has changed meanwhile, it asks a question first.")
_control("abort", "End RUN as its mission defines it (on_abort); this cannot be undone.")


@mission.command("answer")
@click.argument("answer", type=click.Choice(["continue", "abort"]))
@click.argument("run", required=False, default="")
@reach_option
@with_output
def answer(out: Output, answer: str, run: str, *, file: str | None) -> ExitCode:
    """Answer the question that RUN asks, which fleet mission ps shows: go on, or end it."""
    goes_on = answer == "continue"
    return _controlled(
        out,
        file,
        run,
        lambda who: RunControlRequest("answer", goes_on=goes_on, session_id=who),
        requests=True,
    )


@mission.command("log")
@click.argument("run", required=False, default="")
@reach_option
@with_output
def story(out: Output, run: str, *, file: str | None) -> ExitCode:
    """Show the log of RUN, step by step; of the newest run when left out."""
    with Edges.reach(file) as edges:
        state = find_run(edges, run, ended=True)
        lines = mission_requests.story(edges, state.edge, state.run)
    out.data({"run": state.run, "log": [msgspec.to_builtins(each) for each in lines]})
    for each in lines:
        clock = time.strftime("%H:%M:%S", time.localtime(each.stamp))
        out.say(f"{clock} {log_line(each.text, each.robot, each.step)}")
    return ExitCode.OK


@mission.command("results")
@click.argument("run", required=False, default="")
@reach_option
@with_output
def results(out: Output, run: str, *, file: str | None) -> ExitCode:
    """List the results of RUN on its edge's disk: tracks, pictures, its log; of the newest when left out.

    A track is CSV: Unix seconds, then x, y, z in metres.
    """
    with Edges.reach(file) as edges:
        state = find_run(edges, run, ended=True)
        found = mission_requests.results(edges, state.edge, state.run)
        log = mission_requests.story(edges, state.edge, state.run)
    listed = [msgspec.to_builtins(each) for each in found]
    out.data({"run": state.run, "edge": state.edge, "results": listed, "log": len(log)})
    rows = [
        [each.kind, each.robot, f"{each.points} points" if each.points else f"{each.bytes} bytes", each.file]
        for each in found
    ]
    out.table(
        ["kind", "robot", "size", "file"],
        [*rows, ["log", "", f"{len(log)} lines", f"fleet mission log {state.run}"]],
    )
    return ExitCode.OK


def _controlled(
    out: Output,
    file: str | None,
    run: str,
    request: Callable[[str], RunControlRequest],
    *,
    requests: bool = False,
) -> ExitCode:
    """Control a run and confirm it."""
    with Edges.reach(file) as edges:
        state = find_run(edges, run)
        wanted = request(local_user())
        if requests and state.question is not None:
            wanted = msgspec.structs.replace(wanted, question=state.question.id)
        refusal = mission_requests.control(edges, state.edge, state.run, wanted).refusal
    if refusal:
        raise Refused(f"run {state.run}: {refusal}")
    out.data({"run": state.run, "ok": True})
    out.say(f"run {state.run}: {wanted.do} taken")
    return ExitCode.OK


def _require_a_pilot(what: str, robots: tuple[str, ...]) -> None:
    """Raise UsageError for a plan without an aircraft."""
    if Path(what).suffix in PLAN_FILES and not robots:
        raise click.UsageError("a plan is flown by one aircraft: --robot NAME")


def _roles_of(what: str) -> list[str]:
    """Return the roles of a mission file; empty for a mission of fleet.yaml."""
    _, sent = mission_named(what)
    declared = sent.get("roles") if sent is not None else None
    return list(declared) if isinstance(declared, dict) else []


def _chosen(robots: tuple[str, ...], what: str) -> dict[str, list[str]]:
    """Return the chosen robots by role; the role is optional if the mission has only one."""
    chosen: dict[str, list[str]] = {}
    for each in robots:
        role, equals, name = each.rpartition("=")
        if not equals:
            roles = _roles_of(what)
            if len(roles) != 1:
                raise click.UsageError(f"--robot {name}: say for which role, as in --robot eye={name}")
            role = roles[0]
        chosen.setdefault(role, []).append(name)
    return chosen
