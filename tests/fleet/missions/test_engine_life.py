"""What holds of a run whatever happens, in whatever order, and however often the process dies."""

from collections import Counter

import msgspec
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from fleet.missions.engine import Engine
from fleet.missions.program import (
    Act,
    Again,
    Ask,
    Condition,
    Do,
    Enter,
    Leave,
    Loop,
    Program,
    Require,
    Wait,
    WaitFor,
)
from fleet.missions.state import (
    GOING_ON,
    NEXT,
    Abort,
    Begin,
    BeginTogether,
    Dismiss,
    EmergencyStop,
    Ended,
    Enlist,
    Enlisted,
    Facts,
    Left,
    NotStarted,
    Occupy,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    PlaceOccupied,
    Prepare,
    Replied,
    Restarted,
    Resume,
    RobotEvent,
    RobotPrepared,
    RunHead,
    RunMember,
    Start,
    StepPart,
    StopAll,
    Tick,
)

ROBOTS = {"kestrel": "eye", "beast": "feet", "rover": "feet"}
SPARE = "spot"
ACTING = frozenset({Phase.STEP, Phase.HALTING, Phase.UNDOING, Phase.ENDING})
"""Phases in which the run waits for robots that act."""
GONE = [PartOutcome.LOST, PartOutcome.TAKEN, PartOutcome.STOPPED]
ENDS = [
    PartOutcome.DONE,
    PartOutcome.DONE,
    PartOutcome.DONE,
    PartOutcome.FAILED,
    PartOutcome.REFUSED,
    PartOutcome.UNKNOWN,
]
CONDITIONS = st.sampled_from(
    [
        None,
        None,
        Condition("eye", event="person"),
        Condition("all", battery_min=30),
        Condition("feet", health="ok"),
    ]
)
ACTS = st.builds(
    Act,
    verb=st.sampled_from(["command", "goto", "plan"]),
    value=st.sampled_from(["x", "land"]),
    timeout=st.sampled_from([5.0, 60.0]),
    retry=st.integers(0, 2),
)
FOLLOWS = st.builds(
    Act, verb=st.just("follow"), value=st.sampled_from(["eye", "feet"]), timeout=st.just(86_400.0)
)
PLAYS = {"kestrel": {"in.up": 0, "in.all": 0}, "beast": {"in.down": 0, "in.all": 0}}
"""Roles of the mission within the mission; the rover does not take part in it."""


def by_role(*roles):
    acts = st.one_of(ACTS, ACTS, FOLLOWS).map(lambda act: (act,))
    return st.dictionaries(st.sampled_from(roles), acts, min_size=1, max_size=2)


def undone_by(*roles):
    return st.dictionaries(st.sampled_from(roles), ACTS.map(lambda act: (act,)), min_size=1, max_size=2)


BY_ROLE = by_role("eye", "feet", "all")
DOS = st.builds(
    Do,
    id=st.just("do"),
    acts=BY_ROLE,
    only_if=CONDITIONS,
    finish=st.sampled_from(["all", "any", "eye"]),
    together=st.booleans(),
    failed_do=st.sampled_from(["hold", "land"]),
    failed_then=st.sampled_from(["continue", "wait", "fail"]),
    undo=st.one_of(st.just({}), undone_by("eye", "feet", "all")),
)
OTHERS = st.one_of(
    st.builds(Wait, id=st.just("wait"), seconds=st.just(10.0), only_if=CONDITIONS),
    st.builds(
        WaitFor,
        id=st.just("for"),
        condition=CONDITIONS.filter(bool),
        timeout=st.just(30.0),
        fails=st.booleans(),
    ),
    st.builds(
        Ask,
        id=st.just("ask"),
        text=st.just("Go on?"),
        timeout=st.just(30.0),
        on_timeout=st.sampled_from(["continue", "abort", "fail"]),
    ),
)


@st.composite
def inner_missions(draw, begin):
    """Draw a mission within the mission, whose first instruction has the index ``begin``."""
    acts = by_role("in.up", "in.down", "in.all")
    dos = st.builds(
        Do,
        id=st.just("in.do"),
        acts=acts,
        finish=st.sampled_from(["all", "any", "in.up"]),
        together=st.booleans(),
        failed_then=st.sampled_from(["continue", "wait", "fail"]),
        undo=st.one_of(st.just({}), undone_by("in.up", "in.down", "in.all")),
        require=st.sampled_from([None, Require(battery_min=20)]),
    )
    inner = draw(st.lists(st.one_of(dos, dos, OTHERS), min_size=1, max_size=3))
    enter = Enter(
        "in",
        "inner",
        "in.all",
        begin + len(inner) + 2,
        draw(st.sampled_from([{"in.up": 1}, {"in.up": 1, "in.down": 1}, {"in.down": 0}])),
        draw(st.sampled_from([None, 50.0])),
        failed_do=draw(st.sampled_from(["hold", "land"])),
        failed_then=draw(st.sampled_from(["continue", "wait", "fail"])),
        only_if=draw(CONDITIONS),
    )
    return [enter, *inner, Leave(begin, "in")]


@st.composite
def programs(draw):
    steps = [draw(DOS), *draw(st.lists(st.one_of(DOS, DOS, OTHERS), max_size=3))]
    if draw(st.booleans()):
        inner = draw(st.lists(st.one_of(DOS, OTHERS), min_size=1, max_size=2))
        until = draw(CONDITIONS)
        begin = len(steps)
        steps += [Loop("again", draw(st.integers(1, 3)), begin + len(inner) + 2, until), *inner, Again(begin)]
    if draw(st.booleans()):
        steps += draw(inner_missions(begin=len(steps)))
    return Program(
        "mission",
        tuple(steps),
        draw(st.sampled_from([{"eye": 1, "feet": 1}, {"eye": 1, "feet": 2}, {"feet": 1}])),
        draw(st.sampled_from([Require(), Require(battery_min=20)])),
        occupies=draw(st.sampled_from([(), (), ("gate",)])),
        deadline=draw(st.sampled_from([None, None, 400.0])),
        on_failure=draw(st.sampled_from(["hold", "undo", "stop"])),
        on_abort=draw(st.sampled_from(["hold", "land"])),
        on_restart=draw(st.sampled_from(["fail", "hold_and_ask", "continue"])),
    )


class Life(RuleBasedStateMachine):
    """A run, its robots as they are in truth, and what was recorded of it."""

    @initialize(program=programs(), spare=st.booleans())
    def begin(self, program, spare):
        self.program = program
        self.now = 0.0
        self.begun = set()
        self.tries = Counter()
        self.not_ours = {SPARE}
        self.enlisting = False
        self.stopped = False
        self.ended = []
        self.waiting = {}
        self.preparing = {}
        self.occupying = False
        self.together = ""
        members = [
            RunMember(robot, role, at, PLAYS.get(robot, {}))
            for at, (robot, role) in enumerate(ROBOTS.items())
        ]
        if spare:
            members.append(RunMember(SPARE, "feet", 0, ours=False, within=False, spare=True))
        self.recorded = {member.robot: msgspec.json.encode(member) for member in members}
        self.parts = {}
        self.engine = Engine("run", program, members)
        self.head = msgspec.json.encode(self.engine.head)
        self.phase = self.engine.head.phase
        for robot in (*ROBOTS, SPARE):
            self.send(Facts(robot, "ok", 80.0, (0.0, 0.0, 0.0)))
        self.send(Start())

    def record(self):
        for each in self.engine.changes():
            where = self.parts if isinstance(each, StepPart) else self.recorded
            where[each.identity if isinstance(each, StepPart) else each.robot] = msgspec.json.encode(each)
        self.head = msgspec.json.encode(self.engine.head)

    def send(self, event, *, dies=False):
        over = self.engine.over
        effects = self.engine.handle(event, self.now)
        assert self.engine.head.phase in NEXT[self.phase] | {self.phase}, (self.phase, self.engine.head.phase)
        self.phase = self.engine.head.phase
        assert not (over and effects), "nothing follows the end"
        self.record()
        for effect in effects:
            self.check(effect)
            if not dies:
                self.carry_out(effect)

    def check(self, effect):
        match effect:
            case BeginTogether(_, parts):
                for part in parts:
                    self.check(Begin(part))
            case Begin(part):
                assert part.identity not in self.begun, f"{part.identity} is begun twice"
                assert part.robot not in self.not_ours, f"{part.robot} is commanded and not ours"
                assert part.identity in self.parts, f"{part.identity} is not recorded"
                assert not (self.stopped and part.kind != "halt"), "something follows an emergency stop"
                self.begun.add(part.identity)
                self.tried(part)
            case Prepare(robot=robot) | EmergencyStop((robot,)):
                assert robot not in self.not_ours
            case Ended():
                self.ended.append(effect)
                assert len(self.ended) == 1
            case _:
                pass

    def tried(self, part):
        """Count the attempts of a robot at its task in a step."""
        if part.kind == "do":
            self.tries[part.step, part.robot] += 1
            assert self.tries[part.step, part.robot] <= 1 + part.act.retry, f"{part.identity} is one too many"

    def carry_out(self, effect):
        match effect:
            case BeginTogether(_, parts):
                self.together = effect.step
                for part in parts:
                    self.carry_out(Begin(part))
            case Begin(part):
                assert not (self.occupying and part.kind == "do"), (
                    "nothing begins before its places are its own"
                )
                self.waiting[part.identity] = part
            case Enlist(robot):
                assert robot == SPARE
                self.enlisting = True
            case Dismiss(robot):
                assert robot == SPARE
                self.not_ours.add(robot)
            case Occupy():
                self.occupying = True
            case Prepare(robot=robot):
                self.preparing[robot] = effect
            case EmergencyStop(robots):
                self.not_ours |= set(robots)
            case _:
                pass

    @invariant()
    def it_waits_for_an_event(self):
        """Check that the run waits for an event that can still occur, not only for the next tick."""
        phase, robots = self.engine.head.phase, self.engine.robots
        if phase is Phase.PREPARING:
            assert any(robots.members[robot].within for robot in self.preparing), "no robot prepares"
        elif phase in ACTING:
            acting = robots.active()
            assert acting, f"no robot acts, and the run stays in phase {phase}"
            led = all(part.kind == "do" and part.act.verb == "follow" for part in acting)
            assert phase is not Phase.STEP or not led, "all that act follow"

    @rule(seconds=st.sampled_from([0.2, 3.0, 20.0, 120.0]))
    def time_passes(self, seconds):
        self.now += seconds
        self.send(Tick())

    @rule(outcome=st.sampled_from(ENDS))
    def what_it_waits_for_occurs(self, outcome):
        """Bring about the event that the run waits for."""
        head = self.engine.head
        match head.phase:
            case Phase.OCCUPYING:
                self.occupying = False
                self.send(PlaceOccupied())
            case Phase.FILLING:
                self.enlisting = False
                self.not_ours.discard(SPARE)
                self.send(Enlisted(SPARE))
            case Phase.PREPARING:
                for robot in sorted(self.preparing):
                    self.send(RobotPrepared(robot))
                self.preparing.clear()
            case Phase.PAUSED if head.question is None:
                self.send(Resume("anna"))
            case Phase.PAUSED | Phase.ASKING:
                self.send(PersonAnswer(head.questions, True, "anna"))
            case Phase.WAITING:
                self.now += 30.0
                self.send(Tick())
            case _ if self.active():
                self.reply((self.active("do") or self.active())[0], outcome)

    def active(self, *kinds):
        """Return the identities of the parts whose outcome the run waits for."""
        return [part.identity for part in self.engine.robots.active(*kinds)]

    def reply(self, identity, outcome):
        self.waiting.pop(identity, None)
        self.send(Replied(identity, outcome, "so it was"))

    def tasks(self):
        """Return the identities of the tasks of the step in progress; let a step begin before if none is."""
        for _ in range(4):
            if self.engine.head.phase is Phase.STEP:
                break
            self.what_it_waits_for_occurs(PartOutcome.DONE)
        return self.active("do") if self.engine.head.phase is Phase.STEP else []

    @precondition(lambda self: self.engine.head.phase in GOING_ON)
    @rule(outcome=st.sampled_from([PartOutcome.FAILED, PartOutcome.REFUSED]))
    def a_robot_fails_at_its_task(self, outcome):
        for identity in self.tasks()[:1]:
            self.reply(identity, outcome)

    @precondition(lambda self: self.engine.head.phase in GOING_ON)
    @rule(outcome=st.sampled_from(GONE))
    def the_last_robot_of_a_step_leaves(self, outcome):
        """Let all others finish before."""
        *others, last = self.tasks() or [""]
        for identity in others:
            self.reply(identity, PartOutcome.DONE)
        if last:
            self.leave(self.engine.robots.parts[last].robot, outcome)

    @precondition(lambda self: self.waiting)
    @rule(data=st.data(), outcome=st.sampled_from(ENDS))
    def a_robot_replies(self, data, outcome):
        self.reply(data.draw(st.sampled_from(sorted(self.waiting))), outcome)

    @precondition(lambda self: self.waiting)
    @rule(data=st.data())
    def an_answer_comes_twice(self, data):
        identity = data.draw(st.sampled_from(sorted(self.waiting)))
        self.send(Replied(identity, PartOutcome.DONE))
        self.send(Replied(identity, PartOutcome.FAILED, "no"))

    @precondition(lambda self: self.preparing)
    @rule(data=st.data(), refusal=st.sampled_from(["", "", "", "no"]))
    def a_robot_is_prepared(self, data, refusal):
        robot = data.draw(st.sampled_from(sorted(self.preparing)))
        del self.preparing[robot]
        self.send(RobotPrepared(robot, refusal))

    @precondition(lambda self: self.enlisting)
    @rule(refusal=st.sampled_from(["", "", "no"]))
    def a_spare_answers(self, refusal):
        self.enlisting = False
        if not refusal:
            self.not_ours.discard(SPARE)
        self.send(Enlisted(SPARE, refusal))

    @precondition(lambda self: self.together)
    @rule()
    def nobody_is_started(self):
        step, self.together = self.together, ""
        self.send(NotStarted(step, "the instant came before all had taken it"))

    @precondition(lambda self: self.occupying)
    @rule(
        event=st.sampled_from(
            [PlaceOccupied(), PlaceOccupied(), PlaceOccupied("gate"), PlaceOccupied(late="no")]
        )
    )
    def it_hears_of_its_places(self, event):
        self.occupying = self.occupying and bool(event.waits_for)
        self.send(event)

    @rule(robot=st.sampled_from(sorted(ROBOTS)), outcome=st.sampled_from(GONE))
    def a_robot_leaves(self, robot, outcome):
        self.leave(robot, outcome)

    def leave(self, robot, outcome):
        self.not_ours.add(robot)
        self.send(Left(robot, outcome, "gone"))

    @rule(
        robot=st.sampled_from(sorted(ROBOTS)),
        battery=st.sampled_from([None, 5.0, 80.0]),
        health=st.sampled_from(["ok", "fault"]),
        x=st.sampled_from([0.0, 9.0]),
        progress=st.sampled_from(["", "50 %", "60 %"]),
    )
    def something_is_seen(self, robot, battery, health, x, progress):
        self.send(Facts(robot, health, battery, (x, 0.0, 0.0), progress))

    @rule(robot=st.sampled_from(sorted(ROBOTS)))
    def a_person_is_seen(self, robot):
        self.send(RobotEvent(robot, "person"))

    @rule()
    def somebody_pauses(self):
        self.send(Pause("anna"))

    @rule()
    def somebody_resumes(self):
        self.send(Resume("anna"))

    @rule(goes_on=st.booleans(), question=st.integers(0, 3))
    def somebody_answers(self, goes_on, question):
        self.send(PersonAnswer(question, goes_on, "anna"))

    @rule(rare=st.integers(0, 4))
    def somebody_aborts(self, rare):
        if rare == 4:
            self.send(Abort("anna"))

    @rule(rare=st.integers(0, 4), robots=st.sets(st.sampled_from(sorted(ROBOTS)), min_size=2))
    def several_are_stopped(self, rare, robots):
        if rare == 4:
            self.not_ours |= robots
            self.stopped = True
            self.send(StopAll(tuple(sorted(robots)), "anna"))

    @rule(seconds=st.sampled_from([0.0, 5.0, 100.0]), rare=st.integers(0, 2))
    def the_process_dies(self, seconds, rare):
        if rare == 2:
            self.restart(seconds)

    @rule(outcome=st.sampled_from(ENDS), seconds=st.sampled_from([0.0, 5.0]), rare=st.integers(0, 2))
    def the_process_dies_before_it_commands(self, outcome, seconds, rare):
        """Record what an event led to, and carry out nothing of it."""
        if rare != 2:
            return
        event = Tick()
        if self.waiting:
            identity = min(self.waiting)
            del self.waiting[identity]
            event = Replied(identity, outcome)
        self.send(event, dies=True)
        self.restart(seconds)

    def restart(self, seconds):
        if self.engine.over:
            return
        self.now += seconds
        self.waiting, self.preparing, self.occupying = {}, {}, False
        self.enlisting = False
        self.engine = Engine(
            "run",
            self.program,
            [msgspec.json.decode(each, type=RunMember) for each in self.recorded.values()],
            head=msgspec.json.decode(self.head, type=RunHead),
            parts=[msgspec.json.decode(each, type=StepPart) for each in self.parts.values()],
        )
        for robot in (*ROBOTS, SPARE):
            self.send(Facts(robot, "ok", 80.0, (0.0, 0.0, 0.0)))
        self.send(Restarted())

    def teardown(self):
        """Nobody answers any more, and nobody cares: the run ends all the same."""
        if not hasattr(self, "engine"):
            return
        self.send(Resume())
        for _ in range(400):
            if self.engine.over:
                break
            self.now += 61.0
            self.send(Tick())
            if self.engine.head.phase is Phase.PAUSED and self.engine.head.question is None:
                self.send(Resume())
        assert self.engine.over, self.engine.head
        assert self.engine.head.outcome is not None
        assert len(self.ended) == 1
        assert all(not part.inflight for part in self.engine.robots.parts.values())


TestLife = Life.TestCase
TestLife.settings = settings(
    max_examples=150,
    stateful_step_count=30,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
