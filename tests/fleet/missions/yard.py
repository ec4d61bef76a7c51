"""An edge whose robots answer by hand, and whose event loop is the test's own."""

import json

import msgspec

from fleet.config.missions import mission_of
from fleet.missions.points import SiteMap
from fleet.missions.report import MissionStartRequest
from fleet.missions.roles import RoleCandidate
from fleet.missions.runs import Runs
from fleet.missions.state import Facts
from fleet.missions.store import RunStore
from fleet.model.command import Reply, ReplyStatus, Request, Transport
from fleet.model.geodesy import GeoOrigin
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.testing.clock import ManualClock

MISSION = {
    "version": 1,
    "roles": {"eye": {"from": "kestrel"}, "feet": {"from": "beast"}},
    "steps": [
        {"id": "up", "do": {"eye": "takeoff"}, "undo": {"eye": "land"}},
        {"id": "go", "do": {"all": {"goto": [1, 2]}}},
    ],
    "on_failure": "undo",
}


class Robot:
    """A robot that does what it is told when the test says so."""

    def __init__(self, name):
        self.name = name
        self.requests = []
        self.messages = []
        self.waiting = {}
        self.refuses = {}
        self.shows = True  # its state says that it has joined a run
        here = Vector3(0.0, 0.0, 0.0)
        self.now = RobotState(
            name,
            "t",
            "toy",
            "yard",
            0.0,
            "ok",
            reachable=True,
            battery=80.0,
            site=here,
            placement=Placement(here, 0.0),
        )

    def state(self):
        return self.now

    def be(self, **fields):
        self.now = msgspec.structs.replace(self.now, **fields)

    def read(self, kind, payload, *, transport, request_id="", waits=False):
        message = json.loads(payload)
        return Request(lambda answer: self._take(message, transport, request_id, answer))

    def _take(self, message, transport, request_id, answer):
        name = message["command"]
        self.requests.append((name, request_id))
        self.messages.append(message)
        if name in self.refuses:
            answer(Reply(name, ReplyStatus.REJECTED, self.refuses[name]))
        elif name == "join_run":
            self.be(run=message["data"]["run"] if self.shows else "")
            answer(Reply(name, ReplyStatus.ACCEPTED, done=True))
        elif name == "leave_run":
            self.be(run="")
            answer(Reply(name, ReplyStatus.ACCEPTED, done=True))
        else:
            answer(Reply(name, ReplyStatus.ACCEPTED))
            self.waiting[name] = answer

    def done(self, name):
        self.waiting.pop(name)(Reply(name, ReplyStatus.ACCEPTED, done=True))

    @property
    def names(self):
        return [name for name, _ in self.requests if name not in ("join_run", "leave_run")]


class Start:
    """A common start of robots, which the test lets begin, or fail."""

    def __init__(self, yard):
        self.yard = yard
        self.prepared = {}
        self.robots = []
        self.withdrawn = False
        yard.starts.append(self)

    def prepare(self, robot, kind, payload, *, transport, identity, heard):
        message = json.loads(payload)
        refusal = self.yard.robots[robot].refuses.get(message["command"])
        self.prepared[robot] = message, transport, identity, heard
        self.yard.soon.append(
            lambda: heard(
                Reply("x", ReplyStatus.REJECTED if refusal else ReplyStatus.ACCEPTED, refusal or "")
            )
        )

    def begin(self, robots, failed):
        self.robots, self.fail = list(robots), failed

    def instant(self):
        """Be the instant at which all begin."""
        for robot in self.robots:
            self.yard.robots[robot]._take(*self.prepared[robot])
        self.yard.settle()

    def withdraw(self):
        self.withdrawn = True


class Yard:
    """An edge's runs, whose event loop is the test's own."""

    def __init__(self, folder):
        self.folder = folder
        self.clock = ManualClock()
        self.robots = {name: Robot(name) for name in ("kestrel", "beast")}
        self.denied = {}
        self.states = []
        self.stopped = []
        self.soon = []
        self.starts = []
        self.hindered = {}
        self.edge_of = {}
        self.can = {"takeoff", "land", "goto"}
        self.store = None
        self.begin()

    def begin(self):
        """Be another process with the same disk."""
        if self.store is not None:
            self.store.close()
        self.store = RunStore(self.folder)
        self.soon.clear()
        self.runs = Runs(
            "yard",
            self.robots,
            candidates=lambda: [
                RoleCandidate(name, "toy", frozenset(self.can), Facts(name, "ok", 80.0), run=robot.now.run)
                for name, robot in self.robots.items()
            ],
            allowed=lambda robot, origin, _commands, _navigates: self.denied.get((robot, origin.transport)),
            site=SiteMap(
                {
                    "gate": Place("gate", (4.0, 5.0)),
                    "pad": Place("pad", (6.0, 7.0), capacity=2),
                    "hill": Place("hill", (47.001, 8.001, 12.0), "geodetic"),
                },
                GeoOrigin(47.0, 8.0, 400.0),
            ),
            store=self.store,
            clock=self.clock,
            soon=self.soon.append,
            edge_of=lambda robot: self.edge_of.get(robot, ""),
            blocker=lambda robot, act: self.hindered.get((robot, act.words), ""),
            together=lambda: Start(self),
            stop=lambda robots, why: self.stopped.append(robots),
            on_change=self.states.append,
        )

    def settle(self):
        """Let the disk and the loop do what waits."""
        for _ in range(20):
            self.store._thread.submit(lambda: None).result(20)
            calls, self.soon[:] = list(self.soon), []
            for call in calls:
                call()

    def start(
        self, mission=MISSION, *, run="3f2a", transport=Transport.BUS, others=None, settles=True, **fields
    ):
        began = []
        ask = MissionStartRequest(run=run, session_id="anna", **fields)
        found = mission_of("patrol", mission, others)
        self.runs.start(found, found.program({}), ask, transport, lambda *given: began.append(given))
        if settles:
            self.settle()
        return began

    def controlled(self, run, ask):
        """Control a run; return the list that gets why it was refused, empty for nothing."""
        answers = []
        self.runs.control(run, ask, answers.append)
        self.settle()
        return answers

    def control(self, run, ask):
        """Control a run in a way that is answered at once; return why it was refused."""
        answers = []
        self.runs.control(run, ask, answers.append)
        (refusal,) = answers
        return refusal

    def turn(self, seconds=0.2):
        self.clock.advance(seconds)
        self.runs.poll()
        self.settle()

    def done(self, robot, name):
        self.robots[robot].done(name)
        self.settle()

    @property
    def last(self):
        return self.states[-1]
