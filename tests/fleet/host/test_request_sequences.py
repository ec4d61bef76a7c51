"""What holds for one robot whatever is asked of it, however quickly, and whatever fails meanwhile."""

import asyncio
from unittest import mock

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from fleet.errors import LinkLost, NotReady, Refused, TimedOut
from fleet.model.navigation import Control
from fleet.testing.clock import JumpingLoop
from tests.fleet.host.unruly import MOVES, Host, Mood

WHO = st.sampled_from(["anna", "bert"])
DISCRETE = st.sampled_from(["walk", "sit", "arm", "land", "look"])
STOPS = st.sampled_from(["stop", "hover", "emergency_stop"])
PAUSES = st.sampled_from([0.0, 0.0, 0.02, 0.1, 0.3, 1.0, 3.0, 6.0])
BEFORE = st.sampled_from(["", "drive", "send", "walk"])  # what it is asked for before it is lost or taken
ERRORS = st.sampled_from(
    [None, None, None, Refused("no"), NotReady("busy"), TimedOut("late"), LinkLost("gone"), ValueError("bug")]
)
STOP_ERRORS = st.sampled_from([None, None, None, NotReady("busy"), LinkLost("gone"), "never", ValueError()])
MOODS = st.builds(
    Mood,
    takes=st.sampled_from([0.0, 0.2, 1.0, 4.0, 12.0]),
    raises=ERRORS,
    deaf=st.sampled_from([0.0, 0.0, 0.5, 1.5, 3.0]),
    stops=STOP_ERRORS,
    connects=st.sampled_from([0.0, 0.1, 2.0]),
    drives=st.sampled_from([None, None, None, NotReady("busy"), LinkLost("gone")]),
)
SETTLED = 15.0  # s after which nothing that was asked goes on, with an adapter that behaves


class Requests(RuleBasedStateMachine):
    """One robot, its host, and all that was asked of it."""

    def __init__(self):
        super().__init__()
        self.patience = mock.patch("fleet.host.robot.controller.HALT_WAIT", 20.0)  # on however busy a machine
        self.patience.start()
        self.runner = asyncio.Runner(loop_factory=JumpingLoop)
        self.seen = 0
        self.play(self._begin())

    def play(self, work):
        return self.runner.run(work)

    async def _begin(self):
        self.host = Host()
        self.host.begin()
        await asyncio.sleep(0.5)

    async def _then(self, request, pause):
        one = request()
        await asyncio.sleep(pause)
        return one

    def teardown(self):
        try:
            self.play(self._settle())
            self.settled()
        finally:
            self.play(self._end())
            self.runner.close()
            self.patience.stop()

    async def _end(self):
        await self.host.leave()

    # -- requests --------------------------------------------------------------------------------------

    @rule(name=DISCRETE, who=WHO, pause=PAUSES)
    def command(self, name, who, pause):
        self.play(self._then(lambda: self.host.command(name, who), pause))

    @rule(who=WHO, speed=st.sampled_from([0.5, 0.5, 0.0]), lease=st.sampled_from([None, 2.0]), pause=PAUSES)
    def drive(self, who, speed, lease, pause):
        self.play(self._then(lambda: self.host.drive(who, speed, lease), pause))

    @rule(who=WHO, pause=PAUSES)
    def lead_joints(self, who, pause):
        self.play(self._then(lambda: self.host.lead(who), pause))

    @rule(who=WHO, pause=PAUSES)
    def send(self, who, pause):
        self.play(self._then(lambda: self.host.send(who), pause))

    @rule(what=st.sampled_from(list(Control)), who=WHO, pause=PAUSES)
    def control(self, what, who, pause):
        self.play(self._then(lambda: self.host.control(what, who), pause))

    @rule(name=STOPS, who=WHO, pause=PAUSES)
    def stop(self, name, who, pause):
        self.play(self._stop(name, who, pause))

    async def _stop(self, name, who, pause):
        host = self.host
        given, halted = host.stops_given, host.halts_given
        host.stop(name, who)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        attached = host.robot.controller.attached
        if attached.reachable is not None:
            assert host.stops_given > given, "a stop is handed over at once"
        elif attached.adapter is not None:
            assert host.halts_given > halted, "a stop is written though nobody is heard"
        await asyncio.sleep(pause)

    @rule(name=st.sampled_from(["release_emergency_stop", "restart_adapter", "take"]), who=WHO, pause=PAUSES)
    def request_the_host(self, name, who, pause):
        self.play(self._then(lambda: self.host.own(name, who), pause))

    @rule(before=BEFORE, pause=PAUSES)
    def pilot_takes_over(self, before, pause):
        self.play(self._pilot(before, pause))

    async def _pilot(self, before, pause):
        await self._move(before)
        self.host.pilot()
        motion = self.host.robot.controller.motion
        assert not motion.under_way, f"{motion.activity} goes on after a pilot took over"
        assert not motion.in_control, "the pilot has control"
        assert not self._moving(), "all that moved it has ended"
        await asyncio.sleep(pause)

    # -- what fails ------------------------------------------------------------------------------------

    @rule(mood=MOODS)
    def change_mood(self, mood):
        self.host.mood = mood

    async def _move(self, how):
        """Let it move in this way, if it takes the request."""
        match how:
            case "drive":
                self.host.drive()
            case "send":
                self.host.send()
            case "walk":
                self.host.command("walk")
        await asyncio.sleep(0.0)

    @rule(before=BEFORE, pause=PAUSES)
    def go_silent(self, before, pause):
        self.play(self._go_silent(before, pause))

    async def _go_silent(self, before, pause):
        await self._move(before)
        self.host.machine.heard = False
        await asyncio.sleep(pause)

    @rule(pause=PAUSES)
    def come_back(self, pause):
        self.host.machine.heard = True
        self.play(asyncio.sleep(pause))

    @rule(pause=PAUSES)
    def fault(self, pause):
        self.play(self._then(self.host.fault, pause))

    @rule(pause=PAUSES)
    def die(self, pause):
        self.play(self._die(pause))

    async def _die(self, pause):
        await self.host.die()
        await asyncio.sleep(pause)

    @rule(pause=PAUSES)
    def leave_and_begin_again(self, pause):
        self.play(self._leave(pause))

    async def _leave(self, pause):
        await self.host.leave()
        self.host.begin()
        await asyncio.sleep(pause)

    @rule(pause=PAUSES)
    def wait(self, pause):
        self.play(asyncio.sleep(pause))

    @precondition(lambda self: self.host.requested)
    @rule(number=st.integers(0, 100))
    def settle(self, number):
        self.play(self._settle())
        self.settled()

    async def _settle(self):
        host = self.host
        host.mood, host.machine.heard = Mood(), True
        await asyncio.sleep(SETTLED)
        if host.robot.controller.motion.navigator.ahead is not None:  # paused
            host.control(Control.STOP)
        if host.robot.runner.health.level.word != "ok":
            host.robot.controller.found()
            host.own("restart_adapter")
        await asyncio.sleep(SETTLED)

    # -- what holds ------------------------------------------------------------------------------------

    @invariant()
    def nothing_from_before_an_end_reaches_it(self):
        host = self.host
        requested = {one.tag: one.at for one in host.requested}
        resumed = [one.at for one in host.requested if one.name == "resume"]
        for order in host.machine.reached[self.seen :]:
            if order.kind not in MOVES:
                continue
            at = max([requested[order.tag], *(each for each in resumed if each < order.at)])
            between = [why for end, why in host.ended_at if at < end < order.at]
            if order.kind == "land":  # a fault does not break off a landing
                between = [why for why in between if why != "fault"]
            if order.kind != "goal":
                between = [why for why in between if why != "pause"]
            assert not between, f"{order} was asked before {between}"
            assert not order.latched or order.kind == "land", f"{order} though a stop is set"
            newer = [
                each
                for each in host.machine.reached
                if each.at < order.at and each.tag > order.tag and each.kind in MOVES
            ]
            assert not newer, f"{order} after the newer {newer}"
        self.seen = len(host.machine.reached)

    @invariant()
    def what_is_told_agrees_with_what_happens(self):
        host = self.host
        controller, state = host.robot.controller, host.robot.state()
        if controller.latched:
            assert state.activity == "emergency stop"
            assert state.emergency_stop
        under_way = self._moving()
        assert len(under_way) <= 1
        assert not under_way or state.activity
        motion = host.machine.motion
        if controller.offline and motion is not None and not self._lands(motion[1]):
            assert controller.motion.may_be_moving, f"{motion} goes on, {controller.offline}"

    @invariant()
    def nothing_is_under_way_while_it_is_lost(self):
        controller = self.host.robot.controller
        assert not controller.offline or not controller.in_motion, f"{controller.offline}, but it moves"
        assert not self.host.not_halted, f"it moved and was not halted: {self.host.not_halted}"

    def _moving(self):
        """Return the commands of this process that move it and have no end."""
        host = self.host
        return [
            one
            for one in host.requested
            if one.process == host.process and one.name in MOVES and one.receipt.ended is None
        ]

    def _lands(self, tag):
        """Return whether it lands, or was asked to since this request: a landing is not broken off."""
        return any(one.name == "land" and one.tag >= tag for one in self.host.requested)

    def settled(self):
        host = self.host
        machine, controller = host.machine, host.robot.controller
        motion = machine.motion
        assert motion is None or self._lands(motion[1]), f"{motion} goes on"
        assert not controller.motion.under_way
        assert not controller.motion.may_be_moving
        assert host.robot.state().activity == ("emergency stop" if controller.latched else "")
        assert host.robot.state().health == "ok"
        for one in host.requested:
            if one.process == host.process:
                self.answered(one)

    def answered(self, one):
        reply = one.receipt.ended
        assert reply is not None, f"{one.name} got no end"
        assert reply.done or reply.reason, one
        if reply.done and one.name in MOVES | {"navigate"} and one.receipt.command not in {"stop", "pause"}:
            assert one.tag in self.host.machine.finished, f"{one.name} is not true"
        if reply.done and one.name in {"stop", "hover", "emergency_stop"}:
            later = any(
                other.at > one.at and other.name in MOVES | {"move", "navigate"}
                for other in self.host.requested
            )
            assert one.truths[-1] or later, f"{one.name} is not true"


Requests.TestCase.settings = settings(max_examples=100, stateful_step_count=25, deadline=None)
TestRequests = Requests.TestCase
