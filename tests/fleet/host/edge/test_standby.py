"""One edge of a pair, without the lease service: what it runs, bars and hands over; tests/system has both."""

import asyncio
import contextvars
import threading
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.edge import standby
from fleet.host.edge.standby import ACCEPT, Standby, open_gate, part_in_pair
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.link.gate import GATE, LinkGate
from fleet.model.command import Reply
from fleet.standby.lease import LeaseEntry, LeaseState, Takeover
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE

OTHER = LeaseEntry("right", "right-1", 4)
LEASE, FAILSAFE = 0.5, 2.0  # of the robot: s for which a velocity holds, s until its own fail-safe


class Apart:
    """The part of a separation keeper that knows the place of its robot."""

    placement, at, lost = "there", 1.0, ""

    def lose_placement(self, why):
        self.placement, self.lost = None, why


class Robot:
    """A robot that does not run here."""

    def __init__(self, failsafe=FAILSAFE):
        self.name, self.twin = "rex", "twin-1"
        self.config = SimpleNamespace(setpoint_lease=LEASE, failsafe_after=failsafe, start=object())
        self.apart = Apart()
        self.controller = SimpleNamespace(
            permit=SimpleNamespace(refusal=None, stopped=None),
            latch=EmergencyStopLatch(),
            latched=False,
            offline="",
            guard=SimpleNamespace(apart=self.apart),
        )

    @property
    def refusal(self):
        """Why it may not be moved now, None if it may."""
        return self.controller.permit.refusal()


class Runs:
    """The runs of a process; they end when the test says so."""

    def __init__(self):
        self.ending, self.log, self.ended = False, [], asyncio.Event()

    def suspend_all(self, _robots, why):
        self.log.append(f"suspended: {why}")

    def resume_all(self, _robots):
        self.log.append("resumed")

    async def all_ended(self, _robots):
        await self.ended.wait()


class Keeper:
    """A keeper that only records what it is told."""

    def __init__(self, lease, _store, user, *, clock):
        self.lease, self.user, self.clock = lease, user, clock
        self.log, self.problem = [], ""

    def begin(self):
        self.log.append("begun")

    def hand_over(self, to):
        self.log.append(f"hand over to {to}")

    def accept(self):
        self.log.append("accept")

    def robots_released(self):
        self.log.append("released")

    def close(self):
        self.log.append("closed")


class Question:
    """A request on the bus."""

    def __init__(self, payload=b""):
        self.payload, self.replies = payload, []

    def reply(self, data):
        self.replies.append(msgspec.json.decode(data, type=Reply))

    def close(self):
        self.replies.append("closed")


class Pair:
    """The left edge of a pair, and what it does."""

    def __init__(self, robot):
        self.clock, self.robot, self.runs = ManualClock(), robot, Runs()
        self.holders, self.writes, self.served, self.halted = [], [], [], threading.Event()
        self.answers = {}
        self.process = SimpleNamespace(
            robots={"rex": robot},
            bus=SimpleNamespace(control=SimpleNamespace(declare_queryable=self.answers.__setitem__)),
            clock=self.clock,
            holders=SimpleNamespace(changed=lambda *shown: self.holders.append(shown)),
            claims=SimpleNamespace(pair=frozenset()),
            runs=self.runs,
            supervised=SimpleNamespace(write_until=self.writes.append),
            halt_robots=self.halted.set,
            loop=asyncio.get_running_loop(),
        )
        config = SimpleNamespace(edge=SimpleNamespace(id="left"), pair=["left", "right"], lease=None)
        self.gate = LinkGate(self.clock.monotonic)
        loaded = SimpleNamespace(config=config, digest="one")
        self.edge = Standby(loaded, self.gate, self.process, serve=self.serve)
        self.keeper = self.edge._keeper
        self.edge.begin()

    async def serve(self, *, after_takeover):
        self.served.append(after_takeover)
        try:
            await asyncio.Event().wait()
        finally:
            self.served.append("ended")

    async def hold(self, takeover=None, epoch=5):
        """Get the lease, as its keeper tells it."""
        lease, now = self.keeper.lease, self.clock.monotonic()
        lease.state, lease.epoch, lease.renewed_at = LeaseState.HOLDER, epoch, now
        lease.takeover = takeover or Takeover(OTHER, now)
        self.edge.permit_writes(epoch, lease.writes_until)
        self.edge.changed(LeaseState.HOLDER)
        await self.settle()

    async def lose(self):
        """Lose the lease."""
        self.keeper.lease.state = LeaseState.FENCED
        self.edge.changed(LeaseState.FENCED)
        await self.settle()

    def renew(self):
        """Renew the lease now."""
        self.keeper.lease.renewed_at = self.clock.monotonic()
        self.edge.permit_writes(self.keeper.lease.epoch, self.keeper.lease.writes_until)

    async def request(self, payload=b""):
        """Send a request for a handover; return the reply."""
        question = Question(payload)
        self.answers[keys.failover("left")](question)
        await self.settle()
        reply, closed = question.replies
        assert closed == "closed"
        return reply

    async def settle(self):
        for _ in range(5):
            await asyncio.sleep(0)


@pytest.fixture
async def make_pair(monkeypatch):
    monkeypatch.setattr(standby, "LeaseKeeper", Keeper)
    monkeypatch.setattr(standby, "_store", lambda _config: None)
    monkeypatch.setattr(standby, "digest_of", lambda loaded: loaded.digest)
    made = []

    def make(robot=None):
        made.append(Pair(robot or Robot()))
        monkeypatch.setattr(standby, "boot_time", made[-1].clock.monotonic)
        return made[-1]

    yield make
    for each in made:
        each.runs.ended.set()
        await each.edge.close()


@pytest.fixture
async def pair(make_pair):
    return make_pair()


async def test_no_robot_runs_or_moves_before_the_lease_is_held(pair):
    assert pair.runs.log == ["suspended: no edge of the pair is known to have the lease yet"]
    assert pair.robot.refusal == "this edge does not hold the lease of its pair"
    assert pair.holders == [("twin-1", "right")]
    assert pair.keeper.log == ["begun"]
    assert (pair.edge.role, pair.edge.epoch, pair.served) == ("standby", 0, [])
    assert not pair.gate.permits(0)
    assert pair.process.claims.pair == {"left", "right"}


async def test_the_holder_runs_its_robots_and_serves(pair):
    await pair.hold()
    assert pair.runs.log[-1] == "resumed"
    assert pair.holders[-1] == ("twin-1", "")
    assert (pair.edge.role, pair.edge.epoch, pair.served) == ("holder", 5, [True])
    assert pair.gate.permits(5)
    assert pair.writes == [pair.keeper.lease.writes_until]


async def test_a_robot_that_may_still_move_for_the_edge_before_is_moved_once_its_bound_is_over(pair):
    await pair.hold()
    wait = pair.edge._terms.length + LEASE + FAILSAFE
    assert pair.robot.refusal == f"it may still move for the edge before: wait {wait:.1f} s"
    pair.clock.advance(wait - 0.1)
    pair.renew()
    assert pair.robot.refusal == "it may still move for the edge before: wait 0.1 s"
    pair.clock.advance(0.2)
    assert pair.robot.refusal is None


async def test_a_robot_without_a_fail_safe_is_moved_only_after_a_stop_that_can_have_reached_it(make_pair):
    pair = make_pair(Robot(failsafe=None))
    await pair.hold()
    permit = pair.robot.controller.permit
    waits = "it may still execute a request of the previous edge: stop it first"
    pair.robot.controller.offline = "silent"
    permit.stopped()
    pair.clock.advance(3600.0)
    pair.renew()
    assert pair.robot.refusal == waits
    pair.robot.controller.offline = ""
    assert pair.robot.refusal == waits
    permit.stopped()
    assert pair.robot.refusal is None
    pair.robot.controller.offline = "silent"
    permit.stopped()
    assert pair.robot.refusal is None, "one stop is enough"


async def test_nothing_moves_from_a_standstill_before_the_end_of_the_lease_on(pair):
    await pair.hold(Takeover())
    pair.clock.advance(60.0)
    pair.renew()
    assert pair.robot.refusal is None
    terms = pair.edge._terms
    pair.clock.advance(terms.length - terms.standstill)
    assert pair.gate.permits(5)
    assert pair.robot.refusal == "the lease of this edge ends, or has ended"


async def test_a_permit_of_an_earlier_epoch_permits_nothing_in_a_later_one(pair):
    await pair.hold(Takeover())
    earlier = pair.robot.controller.permit.refusal
    await pair.lose()
    pair.runs.ended.set()
    await pair.settle()
    await pair.hold(Takeover(), epoch=9)
    pair.clock.advance(60.0)
    pair.renew()
    assert pair.robot.refusal is None
    assert earlier() == "the lease of this edge ends, or has ended"


@pytest.mark.parametrize("late", ["a later epoch", "its end"])
async def test_a_lease_that_is_told_too_late_runs_nothing(pair, late):
    if late == "its end":
        pair.runs.ending = True
    else:
        pair.edge.permit_writes = lambda *_: None
        pair.gate.epoch = 6
    await pair.hold()
    assert "resumed" not in pair.runs.log
    assert pair.served == []
    assert pair.robot.refusal == "this edge does not hold the lease of its pair"


async def test_the_place_of_a_robot_that_the_other_edge_may_have_moved_is_not_trusted(pair):
    await pair.hold()
    assert (pair.robot.apart.placement, pair.robot.apart.at) == (None, None)
    assert pair.robot.apart.lost == "edge right may have moved it since its start"


async def test_the_place_of_a_robot_that_nobody_else_moved_is_kept(pair):
    await pair.hold(Takeover(LeaseEntry("left", "left-0", 2)))
    assert (pair.robot.apart.placement, pair.robot.apart.lost) == ("there", "")
    assert pair.served == [False]


async def test_the_end_of_a_lease_halts_at_once_and_frees_it_once_every_link_is_closed(pair):
    await pair.hold()
    await pair.lose()
    assert await asyncio.to_thread(pair.halted.wait, DEADLINE)
    assert pair.runs.log[-1] == "suspended: the lease of the pair has ended here; edge right may have it"
    assert pair.holders[-1] == ("twin-1", "right")
    assert pair.served == [True, "ended"]
    assert pair.gate.epoch == 5, "the last stops are still written"
    assert "released" not in pair.keeper.log
    pair.runs.ended.set()
    await pair.settle()
    assert pair.gate.epoch == 0
    assert pair.keeper.log[-1] == "released"


async def test_the_lease_is_handed_over_on_request_by_its_holder_alone(pair):
    assert (await pair.request()).reason == "edge left does not hold the lease"
    await pair.hold()
    reply = await pair.request()
    assert (reply.command, reply.ok) == ("failover", True)
    assert pair.keeper.log[1:] == ["hand over to right"]


async def test_another_file_is_accepted_only_where_one_waits(pair):
    assert (await pair.request(ACCEPT)).reason == "edge left is not blocked by a different file"
    pair.keeper.lease.seen = msgspec.structs.replace(OTHER, config="two")
    assert pair.edge.problem.startswith("no takeover from edge right: its file says something else")
    assert (await pair.request(ACCEPT)).ok
    assert pair.keeper.log[1:] == ["accept"]
    pair.edge.configure(SimpleNamespace(digest="two"))
    assert (pair.edge.problem, pair.edge.file) == ("", "two")


@pytest.mark.parametrize(("entry", "followed"), [(OTHER, True), (LeaseEntry("left", "left-0"), False)])
async def test_a_standby_sets_the_stops_of_the_holder(pair, entry, followed):
    pair.edge.saw(msgspec.structs.replace(entry, stops={"rex": "fire"}))
    await pair.settle()
    assert pair.robot.controller.latch.set is followed
    assert ("suspended: edge right of the pair has the lease" in pair.runs.log) is followed


async def test_the_stops_of_the_edge_before_are_set_before_the_robots_run(pair):
    stopped = []
    pair.runs.resume_all = lambda _robots: stopped.append(pair.robot.controller.latch.cause)
    await pair.hold(Takeover(msgspec.structs.replace(OTHER, stops={"rex": "fire"}), pair.clock.monotonic()))
    assert stopped == ["set at edge right: fire"]


async def test_stops_are_not_followed_by_the_holder(pair):
    await pair.hold()
    pair.edge.saw(msgspec.structs.replace(OTHER, stops={"rex": "fire"}))
    await pair.settle()
    assert not pair.robot.controller.latch.set


async def test_an_edge_without_a_pair_serves_from_its_begin_to_its_end():
    served = []

    async def serve(*, after_takeover):
        served.append(after_takeover)
        await asyncio.Event().wait()

    alone = part_in_pair(SimpleNamespace(), None, SimpleNamespace(), serve)
    await alone.close()
    alone.begin()
    await asyncio.sleep(0)
    assert served == [False]
    assert (alone.problem, alone.role, alone.epoch) == ("", "", 0)
    alone.ending()
    await alone.close()
    assert alone._serving.cancelled()


def test_links_have_a_gate_only_in_an_edge_of_a_pair():
    context = contextvars.copy_context()
    assert context.run(open_gate, SimpleNamespace(pair=None)) is None
    assert context.run(GATE.get) is None
    gate = context.run(open_gate, SimpleNamespace(pair=["left", "right"]))
    assert context.run(GATE.get) is gate is not None
    assert not gate.permits(0)
