"""Robots of this edge in runs of other edges: who gets a lease, and what is done when it lapses."""

import json

import msgspec
import pytest

from fleet.config.other_edges import PartnerConfig
from fleet.host.edge.coordinators import POLL_INTERVAL, Coordinators
from fleet.host.safety.source_policy import SourcePolicy
from fleet.missions.coordination import LAPSES_AFTER, LeaseAnswer, RobotLeaseRequest
from fleet.missions.run_robots import COMES_DOWN
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.event import EventKind, Severity
from fleet.model.state import RobotState
from fleet.robot_config import Accepts
from fleet.testing.clock import ManualClock

SITE = (47.0, 8.0, 400.0)


class Robot:
    """A robot in a run of another edge, and what it was asked."""

    def __init__(self, name):
        self.name = name
        self.asked = []
        self.refuses = {}
        self.now = RobotState(name, "", "", "barn", 0.0, run="r1")

    def state(self):
        return self.now

    def be(self, **fields):
        self.now = msgspec.structs.replace(self.now, **fields)

    def read(self, kind, payload, *, transport, waits):
        assert (kind, transport, waits) == ("command", Transport.MISSION, True)
        message = json.loads(payload)
        name = message["command"]
        self.asked.append(name)
        self.message = message
        if name == "unknown":
            return None
        return lambda answer: answer(self.refuses.get(name, Reply(name, ReplyStatus.ACCEPTED, done=True)))


class Query:
    """One request over the bus, and its answer."""

    def __init__(self, payload):
        self.payload = payload
        self.answers = []
        self.closed = False

    def reply(self, payload, key):
        self.answers.append((msgspec.json.decode(payload, type=LeaseAnswer), key))

    def close(self):
        self.closed = True


class Barn:
    """An edge with two robots, which the edge yard may have in its runs."""

    def __init__(self):
        self.clock = ManualClock()
        self.robots = {name: Robot(name) for name in ("own", "rex")}
        self.records = []
        self.soon = []
        self.served, self.timers = {}, {}
        policy = SourcePolicy(Accepts(mission=frozenset({"tele"})), simulated=False)
        self.coordinators = Coordinators(
            "barn",
            {"yard": PartnerConfig(coordinates=True), "shed": PartnerConfig()},
            self.robots,
            dict.fromkeys(self.robots, policy),
            site=SITE,
            record=lambda robot, event: self.records.append((robot, event)),
            soon=self.soon.append,
            clock=self.clock,
        )
        self.coordinators.declare(self, self.timers.__setitem__)

    def declare_queryable(self, key, handler):
        self.served[key] = handler

    def settle(self):
        while self.soon:
            self.soon.pop(0)()

    def ask(self, payload):
        """Ask as another edge does; return why it is refused."""
        query = Query(payload)
        ((key, handler),) = self.served.items()
        handler(query)
        assert query.answers == [], "not on the bus's thread"
        self.settle()
        ((answer, answered),) = query.answers
        assert (answered, query.closed, answer.site) == (key, True, SITE)
        return answer.refusal

    def lease(self, run="r1", edge="yard", **fields):
        robots = fields.pop("robots", {"own": "hold"})
        return self.ask(msgspec.json.encode(RobotLeaseRequest(run, edge, robots, **fields)))

    def silent(self, seconds=LAPSES_AFTER):
        """Let nothing be heard of the other edge for a time."""
        self.clock.advance(seconds)
        self.timers[POLL_INTERVAL]()
        self.settle()


@pytest.fixture
def barn():
    return Barn()


def test_an_edge_that_fleet_yaml_does_not_name_gets_no_robot(barn):
    for edge in ("shed", "mill"):
        assert barn.lease(edge=edge, begins=True) == (
            f"fleet.yaml of barn does not let {edge} coordinate its robots (partners)"
        )
    barn.silent()
    assert barn.robots["own"].asked == []


def test_where_no_edge_may_have_robots_nothing_is_served(barn):
    coordinators = Coordinators(
        "barn",
        {"shed": PartnerConfig()},
        barn.robots,
        {},
        site=None,
        record=print,
        soon=barn.soon.append,
        clock=barn.clock,
    )
    barn.served.clear()
    barn.timers.clear()
    coordinators.declare(barn, barn.timers.__setitem__)
    assert (barn.served, barn.timers) == ({}, {})


@pytest.mark.parametrize(
    ("fields", "refusal"),
    [
        ({}, ""),
        ({"transport": "cloud", "source_type": "tele"}, ""),
        ({"transport": "cloud", "source_type": "edit"}, "own: source_type 'edit'; this robot accepts tele"),
        ({"transport": "cloud"}, "own: no source_type; this robot accepts tele"),
        ({"source_type": "edit"}, "own: source_type 'edit'; this robot accepts tele"),
        ({"transport": "mission", "source_type": "edit"}, "own: source_type 'edit'; this robot accepts tele"),
        ({"robots": {"own": "hold", "cow": "hold"}}, "barn has no robot 'cow'"),
    ],
)
def test_a_lease_begins_only_where_its_sender_may_start_missions_of_each_robot(barn, fields, refusal):
    assert barn.lease(begins=True, **fields) == refusal
    barn.silent()
    assert barn.robots["own"].asked == ([] if refusal else ["stop"])


@pytest.mark.parametrize("payload", [b"", b"no json", b"{}", b'{"run": "r1", "edge": "yard", "robots": 7}'])
def test_what_cannot_be_read_is_refused_with_the_reason(barn, payload):
    assert barn.ask(payload)


def test_a_lease_is_renewed_and_what_the_last_one_said_is_done(barn):
    barn.lease(begins=True)
    barn.silent(LAPSES_AFTER - 0.1)
    assert barn.lease(robots={"own": "walk"}) == ""
    barn.silent(LAPSES_AFTER - 0.1)
    assert barn.robots["own"].asked == []
    barn.silent(0.1)
    assert barn.robots["own"].asked == ["leave_run", "walk"]
    barn.silent(60.0)
    assert barn.robots["own"].asked == ["leave_run", "walk"], "once"


def test_a_lease_that_has_lapsed_is_not_renewed_and_may_be_given_back(barn):
    barn.lease(begins=True)
    barn.silent()
    assert barn.lease() == "the lease has lapsed"
    assert barn.lease(robots={}) == ""


def test_a_renewal_cannot_add_a_robot_whose_policy_was_not_asked(barn):
    barn.lease(begins=True)
    refusal = "a renewal cannot add rex: their policy was not asked"
    assert barn.lease(robots={"own": "hold", "rex": "hold"}) == refusal
    barn.silent()
    assert (barn.robots["own"].asked, barn.robots["rex"].asked) == (["stop"], [])


def test_robots_that_are_given_back_are_not_stopped(barn):
    barn.lease(begins=True, robots={"own": "hold", "rex": "hold"})
    barn.lease(robots={"rex": "hold"})
    barn.silent()
    assert (barn.robots["own"].asked, barn.robots["rex"].asked) == ([], ["stop"])


def test_a_robot_is_stopped_and_told_of_when_its_coordinator_is_silent(barn, caplog):
    barn.lease(begins=True)
    barn.silent()
    ((robot, event),) = barn.records
    assert (robot, event.kind, event.severity) == ("own", EventKind.STOP, Severity.ERROR)
    assert "edge yard, which coordinates run r1, is silent: hold" in caplog.text
    message = barn.robots["own"].message
    assert message == {"command": "stop", "data": {}, "session_id": "lease of yard"}


@pytest.mark.parametrize("run", ["", "r2"])
def test_a_robot_that_has_left_the_run_is_not_touched(barn, run):
    barn.lease(begins=True)
    barn.robots["own"].be(run=run)
    barn.silent()
    assert (barn.robots["own"].asked, barn.records) == ([], [])


@pytest.mark.parametrize("command", sorted(COMES_DOWN))
@pytest.mark.parametrize("last", ["itself", "blink"])
def test_a_robot_that_comes_down_is_left_to_it_and_only_leaves_the_run(barn, command, last):
    barn.lease(begins=True)
    barn.robots["own"].be(last_command=command if last == "itself" else last, activity=command)
    barn.silent()
    assert barn.robots["own"].asked == ["leave_run"]


@pytest.mark.parametrize("command", sorted(COMES_DOWN))
def test_a_robot_that_has_come_down_is_stopped(barn, command):
    barn.lease(begins=True)
    barn.robots["own"].be(last_command=command, activity="")
    barn.silent()
    assert barn.robots["own"].asked == ["stop"]


def test_a_robot_that_is_busy_with_anything_else_is_stopped(barn):
    barn.lease(begins=True)
    barn.robots["own"].be(last_command="walk", activity="walking")
    barn.silent()
    assert barn.robots["own"].asked == ["stop"]


@pytest.mark.parametrize(
    "reply",
    [
        Reply("walk", ReplyStatus.REJECTED, "busy"),
        Reply("walk", ReplyStatus.ACCEPTED, "it slips", done=False),
    ],
)
def test_a_robot_that_cannot_do_what_it_should_is_stopped(barn, reply):
    barn.lease(begins=True, robots={"own": "walk"})
    barn.robots["own"].refuses["walk"] = reply
    barn.silent()
    assert barn.robots["own"].asked == ["leave_run", "walk", "stop"]


@pytest.mark.parametrize("command", ["stop", "leave_run"])
def test_a_refused_stop_is_not_repeated_for_ever(barn, command):
    barn.lease(begins=True, robots={"own": "hold" if command == "stop" else "walk"})
    barn.robots["own"].refuses[command] = Reply(command, ReplyStatus.REJECTED, "no")
    barn.silent()
    assert barn.robots["own"].asked == (["stop"] if command == "stop" else ["leave_run", "walk"])


@pytest.mark.parametrize("trouble", ["removed", "fails"])
def test_one_robot_does_not_keep_the_others_from_being_made_safe(barn, trouble, caplog):
    barn.lease(begins=True, robots={"own": "hold", "rex": "hold"})
    if trouble == "removed":
        del barn.robots["own"]
    else:
        barn.robots["own"].state = None
    barn.silent()
    assert barn.robots["rex"].asked == ["stop"]
    assert ("own could not be made safe" in caplog.text) is (trouble == "fails")
