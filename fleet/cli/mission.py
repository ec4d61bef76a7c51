"""``fleet mission``: missions of a fleet, started, followed and controlled."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable
from pathlib import Path

import click
import msgspec

from fleet.cli.completion import ROBOT
from fleet.cli.edges import Edges
from fleet.cli.local_user import local_user
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, show_error, with_output
from fleet.cli.rehearsals import follow_rehearsal
from fleet.cli.runs import RUN_FILES, follow, one_run, robot_lines, state_line
from fleet.cli.send import pair
from fleet.errors import Refused
from fleet.missions.report import ControlAsk, MissionState, StartAsk
from fleet.missions.words import told_line


@click.group()
def mission() -> None:
    """Missions: what several robots shall do together, and how it ends."""


@mission.command("ls")
@reach_option
@with_output
def ls(out: Output, *, file: str | None) -> ExitCode:
    """List the missions that the running edges know."""
    with Edges.reach(file) as edges:
        found = edges.missions("*")
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
    """Show what a mission takes, its roles and its steps."""
    with Edges.reach(file) as edges:
        found = _known(edges, name)
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
    """Check a mission file and tell every problem in it, with line and column.

    Robots, groups and places are not known here: missions in fleet.yaml are checked against them by fleet
    check. Exit code 3 when there is a problem.
    """
    from fleet.config.missions import Known, read_mission  # noqa: PLC0415 - pydantic is slow to import
    from fleet.config.problems import InvalidConfig  # noqa: PLC0415

    try:
        found = read_mission(path, os.environ, Known())
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


@mission.command("run")
@click.argument("what", metavar="MISSION")
@click.argument("inputs", nargs=-1, metavar="[INPUT=VALUE]...")
@click.option("--robot", "robots", multiple=True, type=ROBOT, help="[ROLE=]ROBOT: who fills a role.")
@click.option("--detach", is_flag=True, help="Start it, and do not follow it.")
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
    losses, 8: ended otherwise, 9: nobody knows.

    For example:  fleet mission run survey.plan --robot kestrel
    """
    given = dict(pair(each) for each in inputs)
    name, sent = _sent(what, robots)
    with Edges.reach(file) as edges:
        chosen = _chosen(robots, sent)
        ask = StartAsk(
            mission=sent, inputs=given, robots=chosen, run=uuid.uuid4().hex[:8], session_id=local_user()
        )
        edge = _edge_of(edges, name, chosen, sent)
        shown = edges.start_mission(edge, name, msgspec.structs.replace(ask, only_fill=True))
        if shown.refusal:
            raise Refused(shown.refusal, hint=shown.hint)
        for role, names in shown.roles.items():
            out.note(f"{role}: {', '.join(names)}")
        started = edges.start_mission(edge, name, msgspec.structs.replace(ask, robots=shown.roles))
        if started.refusal:
            raise Refused(started.refusal, hint=started.hint)
        out.note(f"run {started.run} of {name} started")
        if detach:
            out.data({"run": started.run, "roles": started.roles})
            return ExitCode.OK
        return follow(out, edges, started.run)


@mission.command("rehearse")
@click.argument("what", metavar="MISSION")
@click.argument("inputs", nargs=-1, metavar="[INPUT=VALUE]...")
@click.option("--robot", "robots", multiple=True, type=ROBOT, help="[ROLE=]ROBOT: who fills a role.")
@reach_option
@with_output
def rehearse(
    out: Output, what: str, inputs: tuple[str, ...], *, robots: tuple[str, ...], file: str | None
) -> ExitCode:
    """Carry a mission out with simulated robots, where the robots are now, and tell how it goes.

    No robot moves: the edge does it in a process of its own, faster than real time. MISSION and the exit
    codes are those of run. A mission with rehearse: required is started for an hour after a rehearsal that
    went well.
    """
    name, sent = _sent(what, robots)
    with Edges.reach(file) as edges:
        chosen = _chosen(robots, sent)
        given = dict(pair(each) for each in inputs)
        ask = StartAsk(mission=sent, inputs=given, robots=chosen, session_id=local_user())
        again = " ".join(["fleet mission run", what, *inputs, *(f"--robot {robot}" for robot in robots)])
        return follow_rehearsal(out, edges, _edge_of(edges, name, chosen, sent), name, ask, again)


@mission.command("ps")
@click.option("-a", "--all", "ended", is_flag=True, help="Also runs that have ended.")
@reach_option
@with_output
def ps(out: Output, *, ended: bool, file: str | None) -> ExitCode:
    """Show the runs that are under way, with what each of their robots does."""
    with Edges.reach(file) as edges:
        found = [each for each in edges.runs("*") if ended or not each.outcome]
    out.data({"runs": [msgspec.to_builtins(each) for each in found]})
    for each in found:
        out.say(state_line(each))
        for line in robot_lines(each):
            out.say(f"  {line}")
    if not found:
        out.say("no run is under way")
    return ExitCode.OK


def _control(name: str, summary: str) -> None:
    """Add a command that controls a run."""

    @mission.command(name, help=summary)
    @click.argument("run", required=False, default="")
    @reach_option
    @with_output
    def control(out: Output, run: str, *, file: str | None) -> ExitCode:
        return _controlled(out, file, run, lambda who: ControlAsk(name, session_id=who))  # type: ignore[arg-type]


_control("pause", "Let the robots of RUN hold where they are; its deadline runs on.")
_control("resume", "Let RUN go on, unless something has changed: then it asks.")
_control("abort", "End RUN in the way that its mission says (on_abort); this cannot be taken back.")


@mission.command("answer")
@click.argument("answer", type=click.Choice(["continue", "abort"]))
@click.argument("run", required=False, default="")
@reach_option
@with_output
def answer(out: Output, answer: str, run: str, *, file: str | None) -> ExitCode:
    """Answer the question that RUN asks."""
    goes_on = answer == "continue"
    return _controlled(
        out, file, run, lambda who: ControlAsk("answer", goes_on=goes_on, session_id=who), asks=True
    )


@mission.command("log")
@click.argument("run", required=False, default="")
@reach_option
@with_output
def story(out: Output, run: str, *, file: str | None) -> ExitCode:
    """Tell what happened in RUN, step by step; of the newest run when left out."""
    with Edges.reach(file) as edges:
        state = one_run(edges, run, ended=True)
        lines = edges.story(state.edge, state.run)
    out.data({"run": state.run, "log": [msgspec.to_builtins(each) for each in lines]})
    for each in lines:
        clock = time.strftime("%H:%M:%S", time.localtime(each.stamp))
        out.say(f"{clock} {told_line(each.text, each.robot, each.step)}")
    return ExitCode.OK


def _controlled(
    out: Output, file: str | None, run: str, ask: Callable[[str], ControlAsk], *, asks: bool = False
) -> ExitCode:
    """Control a run; tell that it was taken."""
    with Edges.reach(file) as edges:
        state = one_run(edges, run)
        wanted = ask(local_user())
        if asks and state.question is not None:
            wanted = msgspec.structs.replace(wanted, question=state.question.id)
        refusal = edges.control_run(state.edge, state.run, wanted).refusal
    if refusal:
        raise Refused(f"run {state.run}: {refusal}")
    out.data({"run": state.run, "ok": True})
    out.say(f"run {state.run}: {wanted.do} taken")
    return ExitCode.OK


def _known(edges: Edges, name: str) -> MissionState:
    """Return a mission by its name; raises Refused."""
    found = edges.missions(name)
    if not found:
        known = ", ".join(each.name for each in edges.missions("*")) or "none"
        raise Refused(f"there is no mission {name!r}", hint=f"there are: {known}")
    if len(found) > 1:
        raise Refused(
            f"several edges have a mission {name!r}", hint="name the edge by its file: -f fleet.yaml"
        )
    return found[0]


def _sent(what: str, robots: tuple[str, ...]) -> tuple[str, dict[str, object] | None]:
    """Return a mission's name, and the mission itself where it stands in a file here."""
    path = Path(what)
    if path.suffix not in RUN_FILES:
        return what, None
    name = "".join(each if each.isalnum() else "-" for each in path.stem.lower()) or "plan"
    if path.suffix in {".yaml", ".yml"}:
        from fleet.config.missions import Known, read_mission  # noqa: PLC0415 - pydantic is slow to import

        return name, read_mission(path, os.environ, Known()).data
    if not robots:
        raise click.UsageError("a plan is flown by one aircraft: --robot NAME")
    return name, plan_mission(path)


def plan_mission(path: Path) -> dict[str, object]:
    """Return the mission of one step that lets one aircraft fly a plan file; raises Refused."""
    from fleet.errors import WireError  # noqa: PLC0415
    from fleet.missions.plan import mission_of_plan, plan_in  # noqa: PLC0415

    try:
        return mission_of_plan(plan_in(path.read_bytes()), f"the plan {path.name}")
    except (OSError, WireError) as error:
        raise Refused(f"{path}: {error}") from None


def _chosen(robots: tuple[str, ...], sent: dict[str, object] | None) -> dict[str, list[str]]:
    """Return the robots that a person chose, by role; without a role where the mission has only one."""
    chosen: dict[str, list[str]] = {}
    for each in robots:
        role, equals, name = each.rpartition("=")
        if not equals:
            declared = sent.get("roles") if sent is not None else None
            roles = list(declared) if isinstance(declared, dict) else []
            if len(roles) != 1:
                raise click.UsageError(f"--robot {name}: say for which role, as in --robot eye={name}")
            role = roles[0]
        chosen.setdefault(role, []).append(name)
    return chosen


def _edge_of(edges: Edges, name: str, chosen: dict[str, list[str]], sent: dict[str, object] | None) -> str:
    """Return which edge is to run a mission; raises Refused."""
    if sent is None:
        return _known(edges, name).edge
    owners = {robot.edge for names in chosen.values() for each in names for robot in edges.named(each)}
    owners = owners or {edge.edge for edge in edges.edges()}
    if len(owners) != 1:
        raise Refused(
            f"several edges could run it: {', '.join(sorted(owners))}", hint="-f fleet.yaml says which"
        )
    return owners.pop()
