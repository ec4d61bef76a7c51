"""The missions of an edge: connects ``fleet.missions`` with its robots, files and bus."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from fleet.config.load import Loaded
from fleet.host.edge.cloud_workflows import CloudWorkflows
from fleet.host.edge.common_start import CommonStart
from fleet.host.edge.coordinators import Coordinators
from fleet.host.edge.known_missions import KnownMissions
from fleet.host.edge.mission_queries import MissionQueries
from fleet.host.edge.mission_requesters import MissionRequesters
from fleet.host.edge.mission_robots import Descriptions, MissionRobots, RobotRules, candidate
from fleet.host.edge.mission_routes import MissionRoutes
from fleet.host.edge.mission_starter import MissionStarter
from fleet.host.edge.partners import Partners
from fleet.host.edge.rehearsals import Rehearsals
from fleet.host.edge.robot_reports import RobotReports
from fleet.host.edge.run_reporter import RunReporter
from fleet.host.edge.run_results import RunResults
from fleet.host.edge.start_requests import StartRequests
from fleet.host.edge.twin_plans import TwinPlans
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.missions.results import EVERY as TRACK_EVERY
from fleet.missions.roles import RoleCandidate
from fleet.missions.run import RunPort
from fleet.missions.runs import Runs
from fleet.missions.store import RunStore
from fleet.model.command import Origin
from fleet.model.event import EventReport

POLL_INTERVAL = 0.2  # s
log = logging.getLogger(__name__)


class Missions:
    """The missions and runs of one edge, on its bus."""

    def __init__(
        self,
        loaded: Loaded,
        process: RobotProcess,
        remote: Mapping[str, RemoteRobot],
        folder: Path,
        stop: Callable[[tuple[str, ...], str], None],
    ) -> None:
        config = loaded.config
        self._edge = config.edge.id
        self._missions = missions = KnownMissions(loaded)
        self._groups = config.members
        self._bus_session = process.bus.control
        self._process, requesters = process, MissionRequesters(process.senders)
        self._rules = rules = RobotRules(loaded)
        self._policies = rules.policies
        reporter = RunReporter(
            self._edge, self._bus_session, process.history.add, requesters.starter, process.clock
        )
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
            [*process.robots.values(), *remote.values()],
            self.partners.robots,
            process.outbox.sender,
        )
        self._descriptions = Descriptions(self._bus_session, self._soon, robots.edges)
        self.store = RunStore(folder)
        routes = MissionRoutes(loaded, lambda robot: self.runs.robots[robot].state())
        self.runs = Runs(
            self._edge,
            robots.everyones,
            candidates=self._candidates,
            allowed=self._refusal,
            site=routes.site,
            blocker=routes.blocker,
            edge_of=self.partners.edge_of,
            store=self.store,
            clock=process.clock,
            soon=self._soon,
            stop=partial(self._stop, stop),
            together=partial(CommonStart, self._bus_session, process.clock, routes.state_of),
            on_change=reporter.report,
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
        self.starter = MissionStarter(missions.get, self.runs, self._descriptions.request, process.clock)
        self.starts = StartRequests(self.runs, self._descriptions.request, self._soon)
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
        reporter.listeners += [self.plans.run_changed, self.workflows.run_changed, self.results.run_changed]
        self._queries = MissionQueries(
            self._edge,
            self._bus_session,
            missions,
            self.runs,
            requesters=requesters,
            starts=self.starts,
            rehearsals=self.rehearsals,
            results=self.results,
            store=self.store,
            soon=self._soon,
        )
        self._reported = RobotReports(self._event, self.plans.record_item, self.results.picture_receiver)
        process.outbox.on_photo = self.results.store_picture
        process.on_stop = self.stopped
        self._routes = routes
        self.configured = (rules.configure, self._configure, self.rehearsals.configure)

    def _configure(self, loaded: Loaded) -> None:
        """Start runs with another configuration from now on; running ones keep their copies."""
        self._missions.configure(loaded)
        self._groups = loaded.config.members
        self._routes.configure(loaded)
        if self._routes.site != self.runs.site:
            self.runs.site = self._routes.site
            self.runs.places.configure(self._routes.site.places)

    def blocker(self, section: str) -> str:
        """Return why a section of fleet.yaml cannot be applied now; empty if it can."""
        runs = ", ".join(run.id for run in self.runs.all()) if section == "places" else ""
        return f"run {runs} uses the places: wait for its end" if runs else ""

    def _soon(self, call: Callable[[], None]) -> None:
        """Run a call on the event loop; from any thread."""
        self._process.loop.call_soon_threadsafe(call)

    def _stop(self, stop: Callable[[tuple[str, ...], str], None], names: tuple[str, ...], why: str) -> None:
        """Set the emergency stop of robots, partners' included; ``stop`` without names would stop all."""
        ours = self.partners.stop(names)
        if ours:
            stop(ours, why)

    def close(self) -> None:
        """Stop starting runs, and write pending records; may block."""
        self.starts.close()
        self.results.close()
        self.store.close()

    @property
    def problem(self) -> str:
        """Why runs are not recorded, or earlier runs are lost; empty without a problem."""
        return self.store.problem or self.store.lost

    def declare(self) -> None:
        """Answer queries, watch the robots, and resume the runs of an earlier process."""
        self._queries.declare()
        self._hear_events()
        self.partners.declare(self._process.scheduler.every)
        self.coordinators.declare(self._bus_session, self._process.scheduler.every)
        self.runs.restore_runs()
        self._process.scheduler.every(POLL_INTERVAL, self.runs.poll)
        self._process.scheduler.every(TRACK_EVERY, self.results.record_positions)

    def stopped(self, names: tuple[str, ...], cause: StopCause) -> None:
        """Pass an emergency stop to the runs; from any thread."""
        self._soon(partial(self.runs.stopped, names, cause.sentence))

    def _hear_events(self) -> None:
        """Pass on events and reports of robots: from their hosts and from programs on the bus."""
        tell_others = self._process.history.on_event

        def on_event(robot: str, event: EventReport) -> None:
            tell_others(robot, event)
            self._event(robot, event.kind.value)

        self._process.history.on_event = on_event
        for twin, name in self._robots.names.items():
            self._reported.join(name, twin, remote=name in self._robots.remote)
        self._reported.listen(self._process.bus.reports)

    # -- robots that come and go -----------------------------------------------------------------------

    def join(self, robot: LocalRobot | RemoteRobot) -> None:
        """Add a robot, its rules first, since requests for it are judged by them; on the loop."""
        self._rules.join(robot.config)
        self._routes.join(robot.config)
        self._robots.join(robot)
        self._reported.join(robot.name, robot.twin, remote=robot.name in self._robots.remote)

    def leave(self, name: str) -> None:
        """Remove a robot that is in no run; on the loop."""
        twin = self._robots.leave(name)
        if twin:
            self._reported.leave(twin)
        self._rules.leave(name)
        self._routes.leave(name)

    def _event(self, robot: str, event: str) -> None:
        """Pass a robot's event to the runs, if there are any; from any thread."""
        if self.runs.any:
            self._soon(partial(self.runs.handle_event, robot, event))

    # -- capabilities and permissions ------------------------------------------------------------------

    def _candidates(self) -> list[RoleCandidate]:
        """Return state and capabilities of each robot."""
        here = [(robot.state(), robot.describe()) for robot in self._robots.here.values()]
        others: dict[str, RunPort] = {**self._robots.remote, **self.partners.robots}
        remote = [(robot.state(), self._descriptions.of(name)) for name, robot in others.items()]
        return [candidate(*each, self._groups) for each in (*here, *remote)]

    def _refusal(self, robot: str, origin: Origin, commands: bool, navigates: bool) -> str | None:  # noqa: FBT001 - by position
        """Return why a requester may not start a mission with a robot; None if permitted."""
        policy = self._policies.get(robot)
        if policy is None:  # a partner's edge judges when the robot joins the run
            return None if robot in self.partners.robots else f"{robot} is no robot of this edge"
        return policy.mission_refusal(origin, commands=commands, navigates=navigates)
