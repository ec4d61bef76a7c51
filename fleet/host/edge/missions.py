"""The missions of an edge: its robots, its files and its bus, put together for ``fleet.missions``."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query
from fleet.config.load import Loaded
from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.host.edge.cloud_workflows import CloudWorkflows
from fleet.host.edge.common_start import CommonStart
from fleet.host.edge.coordinators import Coordinators
from fleet.host.edge.known_missions import KnownMissions
from fleet.host.edge.mission_robots import Descriptions, MissionRobots, RobotRules, candidate
from fleet.host.edge.mission_starter import MissionStarter
from fleet.host.edge.mission_ways import MissionWays
from fleet.host.edge.partners import Partners
from fleet.host.edge.rehearsals import Rehearsals
from fleet.host.edge.robot_reports import RobotReports
from fleet.host.edge.run_results import RunResults
from fleet.host.edge.start_requests import StartRequests
from fleet.host.edge.twin_plans import TwinPlans
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.console_asker import console_refusal
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.missions.filling import mission_state
from fleet.missions.report import ControlAsk, Controlled, RunState, StartAsk, Started, ended_state
from fleet.missions.results import EVERY as TRACK_EVERY
from fleet.missions.roles import Candidate
from fleet.missions.run import Robot
from fleet.missions.runs import Runs, check_run_id
from fleet.missions.state import Head, Member
from fleet.missions.store import About, Store, Told
from fleet.model.command import Origin, Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.permission import Permission
from fleet.runtime.decoding import decode_json

LOOK_EVERY = 0.2  # s
SHOWN = 50  # runs that ended
LARGEST = 1 << 20  # bytes of a mission that is sent
_encode = msgspec.json.encode
log = logging.getLogger(__name__)


class Missions:
    """The missions and runs of one edge, on its bus."""

    def __init__(
        self,
        loaded: Loaded,
        process: RobotProcess,
        elsewhere: Mapping[str, RemoteRobot],
        folder: Path,
        stop: Callable[[tuple[str, ...], str], None],
    ) -> None:
        config = loaded.config
        self._edge = config.edge.id
        self._missions = missions = KnownMissions(loaded)
        self._groups = config.members
        self._bus_session = process.bus.control
        self._process = process
        self._recorded: set[str] = set()
        self._rules = rules = RobotRules(loaded)
        self._policies = rules.policies
        self._states = self._bus_session.publishers(keys.run(self._edge, "*"))
        site = config.site.origin
        self.partners = Partners(
            self._edge,
            config.partners,
            self._bus_session,
            site=site,
            soon=self._soon,
            clock=process.clock,
        )
        self._robots = robots = MissionRobots(
            self._edge,
            [*process.robots.values(), *elsewhere.values()],
            self.partners.robots,
            process.outbox.sender,
        )
        self._descriptions = Descriptions(self._bus_session, self._soon, robots.edges)
        self.store = Store(folder)
        ways = MissionWays(loaded, lambda robot: self.runs.robots[robot].state())
        self.runs = Runs(
            self._edge,
            robots.everyones,
            candidates=self._candidates,
            allowed=self._refusal,
            site=ways.site,
            hindrance=ways.hindrance,
            elsewhere=self.partners.edge_of,
            store=self.store,
            clock=process.clock,
            soon=self._soon,
            stop=partial(self._stop, stop),
            together=partial(CommonStart, self._bus_session, process.clock, ways.state_of),
            told=self._publish,
        )
        self.partners.runs = self.runs.all
        self.coordinators = Coordinators(
            self._edge,
            config.partners,
            robots.ours,
            self._policies,
            site=site,
            record=process.history.add,
            soon=self._soon,
            clock=process.clock,
        )
        self.rehearsals = Rehearsals(
            loaded,
            self.runs.filling,
            states=lambda: [robot.state() for robot in robots.everyones.values()],
            folder=folder,
            clock=process.clock,
        )
        self.starter = MissionStarter(missions.get, self.runs, self._descriptions.ask, process.clock)
        self.starts = StartRequests(self.runs, self._descriptions.ask, self._soon)
        self.plans = TwinPlans(
            self.runs,
            self.starts,
            robots.senders,
            self._policies,
            max_age=rules.max_age,
            record=process.history.add,
            soon=self._soon,
            clock=process.clock,
        )
        process.outbox.navigates = self.plans.navigates
        self.workflows = CloudWorkflows(
            config.cloud.workflows if config.cloud else {},
            missions.get,
            self.runs,
            self.starts,
            record=process.history.add,
            clock=process.clock,
        )
        self.results = RunResults(folder, self.runs, robots.everyones, robots.names, process.clock)
        self._reported = RobotReports(self._event, self.plans.heard, self.results.heard)
        process.outbox.pictured = self.results.pictured
        process.on_stop = self.stopped
        self._ways = ways
        self.configured = (rules.configure, self._configure, self.rehearsals.configure)

    def _configure(self, loaded: Loaded) -> None:
        """Begin runs by another configuration; those under way keep their copies."""
        self._missions.configure(loaded)
        self._groups = loaded.config.members
        self._ways.configure(loaded)
        if self._ways.site != self.runs.site:
            self.runs.site = self._ways.site
            self.runs.places.configure(self._ways.site.places)

    def hindrance(self, section: str) -> str:
        """Return why a section of fleet.yaml cannot be taken over now; empty when it can."""
        runs = ", ".join(run.id for run in self.runs.all()) if section == "places" else ""
        return f"run {runs} goes by the places: wait for its end" if runs else ""

    def _soon(self, call: Callable[[], None]) -> None:
        """Run a call on the event loop; from any thread."""
        self._process.loop.call_soon_threadsafe(call)

    def _stop(self, stop: Callable[[tuple[str, ...], str], None], names: tuple[str, ...], why: str) -> None:
        """Set the emergency stop of robots, also of partners'; no name would mean all of ours."""
        ours = self.partners.stop(names)
        if ours:
            stop(ours, why)

    def close(self) -> None:
        """Start nothing more, and write what waits; may wait."""
        self.starts.close()
        self.results.close()
        self.store.close()

    @property
    def problem(self) -> str:
        """Why runs are not recorded, or those of before are lost; empty when all is well."""
        return self.store.problem or self.store.lost

    def declare(self) -> None:
        """Take questions, look at the robots, and take up the runs of an earlier process."""
        self._bus_session.answer(keys.mission(self._edge, "*"), self._asked_mission, more=keys.CONSOLE)
        self._bus_session.answer(keys.run(self._edge, "*"), self._asked_run, more=keys.CONSOLE)
        self._hear_events()
        self.partners.declare(self._process.scheduler.every)
        self.coordinators.declare(self._bus_session, self._process.scheduler.every)
        self.runs.take_up()
        self._process.scheduler.every(LOOK_EVERY, self.runs.turn)
        self._process.scheduler.every(TRACK_EVERY, self.results.look)

    def stopped(self, names: tuple[str, ...], cause: StopCause) -> None:
        """Take note of an emergency stop; from any thread."""
        self._soon(partial(self.runs.stopped, names, cause.why))

    def _hear_events(self) -> None:
        """Take what is reported of robots: by their hosts, and by programs on the bus."""
        tell_others = self._process.history.on_event

        def told(robot: str, event: EventReport) -> None:
            tell_others(robot, event)
            self._event(robot, event.kind.value)

        self._process.history.on_event = told
        for twin, name in self._robots.names.items():
            self._reported.join(name, twin, elsewhere=name in self._robots.elsewhere)
        self._reported.listen(self._process.bus.reports)

    # -- robots that come and go -----------------------------------------------------------------------

    def join(self, robot: LocalRobot | RemoteRobot) -> None:
        """Have one more robot; its rules first, which all that asks for it goes by. On the loop."""
        self._rules.join(robot.config)
        self._ways.join(robot.config)
        self._robots.join(robot)
        self._reported.join(robot.name, robot.twin, elsewhere=robot.name in self._robots.elsewhere)

    def leave(self, name: str) -> None:
        """Have a robot no more, which no run goes by; on the loop."""
        twin = self._robots.leave(name)
        if twin:
            self._reported.leave(twin)
        self._rules.leave(name)
        self._ways.leave(name)

    def _event(self, robot: str, event: str) -> None:
        """Take an event of a robot; from any thread, and for nothing while no run is under way."""
        if self.runs.any:
            self._soon(partial(self.runs.heard, robot, event))

    # -- what robots are and may -----------------------------------------------------------------------

    def _candidates(self) -> list[Candidate]:
        """Return what each robot can and is now."""
        here = [(robot.state(), robot.describe()) for robot in self._robots.here.values()]
        others: dict[str, Robot] = {**self._robots.elsewhere, **self.partners.robots}
        elsewhere = [(robot.state(), self._descriptions.of(name)) for name, robot in others.items()]
        return [candidate(*each, self._groups) for each in (*here, *elsewhere)]

    def _refusal(self, robot: str, origin: Origin, commands: bool, navigates: bool) -> str | None:  # noqa: FBT001 - by position
        """Return why somebody may not start a mission with a robot; None when he may."""
        policy = self._policies.get(robot)
        if policy is None:  # a partner's own edge says so when the robot joins
            return None if robot in self.partners.robots else f"{robot} is no robot of this edge"
        return policy.mission_refusal(origin, commands=commands, navigates=navigates)

    # -- the bus ---------------------------------------------------------------------------------------

    def _publish(self, state: RunState) -> None:
        """Tell a run's state to whoever listens; its beginning and its end go into the history."""
        if state.run not in self._recorded:
            self._recorded.add(state.run)
            robots = ", ".join(f"{each.role} {each.robot}" for each in state.robots)
            how = "started" if state.seconds < 1.0 else "taken up again"
            self._record(state, EventKind.COMMAND, f"mission {state.mission} {how}: {robots}")
        if state.outcome:
            self._recorded.discard(state.run)
            reason = f": {state.reason}" if state.reason else ""
            self._record(state, EventKind.OUTCOME, f"mission {state.mission} {state.outcome}{reason}")
        self.plans.told(state)
        self.workflows.told(state)
        self.results.told(state)
        publisher = self._states.wanted(keys.run(self._edge, state.run))
        if publisher is not None:
            publisher.put(_encode(state))

    def _record(self, state: RunState, kind: EventKind, text: str) -> None:
        """Write an event of a run, with who started it, into the history of the edge."""
        asker = Requester(Transport(state.way), state.by, proven=state.way == Transport.MISSION)
        severity = Severity.INFO if state.outcome in ("", "completed") else Severity.WARNING
        event = EventReport(self._process.clock.time(), kind, text, severity, asker, state.mission, state.run)
        self._process.history.add("", event)

    def _asked_mission(self, question: Query) -> None:
        """Take a question for a mission; on the bus's thread."""
        name, do = question.asked.rpartition("/")[2], question.parameters.get("do")
        if do == "rehearsal":
            self._soon(partial(self.rehearsals.look, question))
            return
        if do not in {"start", "rehearse"}:
            for each in self._missions.by_name.values():
                if "*" in name or each.name == name:
                    question.reply(
                        _encode(mission_state(each, self._edge)), keys.mission(self._edge, each.name)
                    )
            question.close()
            return

        def made() -> tuple[Mission, StartAsk]:
            ask = self._asked(question)
            return self._missions.asked(name, ask), ask

        began = partial(self._tell_started, name, question)
        if do == "rehearse":
            self.starts.check(made, partial(self.rehearsals.begin, question), began)
        else:
            self.starts.begin(made, Transport.BUS, began)

    def _asked(self, question: Query) -> StartAsk:
        """Return what is asked; raises Refused, DecodeError."""
        if "*" in question.asked:
            raise Refused("a mission is started on one edge", hint="name the edge and the mission")
        if len(question.payload) > LARGEST:
            raise Refused(f"the mission is larger than {LARGEST >> 20} MiB")
        ask = decode_json(question.payload, StartAsk)
        if ask.run:
            check_run_id(ask.run)
        needed = Permission.OPERATE if ask.mission is None else Permission.ADMIN
        if refusal := console_refusal(question, needed):
            raise Refused(refusal)
        return ask

    def _tell_started(
        self, name: str, question: Query, run: str, roles: Mapping[str, Sequence[str]], refusal: str
    ) -> None:
        """Answer who asked."""
        started = Started(run, {role: list(robots) for role, robots in roles.items()}, refusal)
        question.answer(_encode(started), keys.mission(self._edge, name))

    def _asked_run(self, question: Query) -> None:
        """Take a question for a run; on the bus's thread."""
        self._soon(partial(self._answer_run, question, question.asked.rpartition("/")[2]))

    def _answer_run(self, question: Query, run: str) -> None:
        """Answer with states, or control a run."""
        if not question.payload:
            self._tell_runs(question, run)
            return
        key = keys.run(self._edge, run)

        def told(refusal: str) -> None:
            question.answer(_encode(Controlled(refusal)), key)

        try:
            ask = decode_json(question.payload, ControlAsk)
        except msgspec.DecodeError as error:
            told(str(error))
            return
        if ask.do == "log":
            self.store.story(run, partial(self._tell_story, question, run))
            return
        if ask.do == "results":
            self.results.answer(question, key, run)
            return
        refusal = console_refusal(question, Permission.OPERATE)
        told(refusal) if refusal else self.runs.control(run, ask, told)

    def _tell_story(self, question: Query, run: str, story: list[Told]) -> None:
        """Answer with a run's story; none of a run that is another edge's."""
        if story:
            question.reply(_encode(story), keys.run(self._edge, run))
        question.close()

    def _tell_runs(self, question: Query, run: str) -> None:
        """Answer with the states of runs that are wanted: those under way, then those that ended."""
        active = self.runs.states()
        for state in active:
            if "*" in run or state.run == run:
                question.reply(_encode(state), keys.run(self._edge, state.run))
        shown = {state.run for state in active}

        def ended(found: list[tuple[About, Head, list[Member]]]) -> None:
            for about, head, members in found:
                if about.run not in shown and ("*" in run or about.run == run):
                    state = ended_state(about, head, members, self._edge)
                    question.reply(_encode(state), keys.run(self._edge, about.run))
            question.close()

        self.store.ended(SHOWN, ended)
