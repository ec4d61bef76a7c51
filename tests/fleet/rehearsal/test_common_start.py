"""The common start of a rehearsal: what could not begin says so, and the others begin at one instant."""

import types

import pytest

from fleet.errors import WireError
from fleet.model.command import Command, Origin, Reply, ReplyStatus, Transport
from fleet.rehearsal import common_start
from fleet.rehearsal.common_start import SimulatedStart


class Robot:
    """A simulated robot that notes when it begins."""

    def __init__(self, name, begun):
        self.controller = self
        self.requests = self
        self._name, self._begun = name, begun
        self.decoded = Command("go", {}, origin=Origin(Transport.BUS))
        self.readable = True

    def spec_of(self, name):
        return f"spec of {name}"

    def read(self, kind, payload, *, transport, request_id, waits):
        assert waits
        self.given = kind, payload, transport, request_id
        return self._begin if self.readable else None

    def decode_request(self, kind, payload, *, transport, request_id):
        assert (kind, payload, transport, request_id) == self.given
        if isinstance(self.decoded, Exception):
            raise self.decoded
        return self.decoded

    def _begin(self, heard):
        self._begun.append(self._name)
        heard(Reply("go", ReplyStatus.ACCEPTED, done=True))


class Bench:
    """A start of two robots, and what is heard of each."""

    def __init__(self):
        self.begun, self.soon, self.heard = [], [], {}
        self.robots = {name: Robot(name, self.begun) for name in ("rex", "ada")}
        self.start = SimulatedStart(self.robots, self.soon.append)

    def prepare(self, name="rex"):
        heard = self.heard.setdefault(name, [])
        self.start.prepare(
            name, "command", b"{}", transport=Transport.BUS, identity=f"1/{name}", heard=heard.append
        )
        assert heard == [], "not before the caller has returned"
        while self.soon:
            self.soon.pop(0)()
        return [(reply.ok, reply.reason, reply.done) for reply in heard]


@pytest.fixture
def bench(monkeypatch):
    bench = Bench()
    bench.trouble = ""
    monkeypatch.setattr(common_start, "against", lambda controller, request, spec: bench.trouble)
    return bench


def test_prepared_robots_begin_at_one_instant_and_in_order(bench):
    for name in ("rex", "ada"):
        assert bench.prepare(name) == [(True, "", None)]
        assert bench.robots[name].given == ("command", b"{}", Transport.BUS, f"1/{name}")
    assert bench.begun == []
    bench.start.begin(["ada", "rex"], pytest.fail)
    assert bench.begun == ["ada", "rex"]
    assert [reply.done for reply in bench.heard["rex"]] == [None, True]


def test_a_robot_that_would_refuse_says_so_and_is_not_prepared(bench):
    bench.trouble = "the goal is outside its fence"
    assert bench.prepare() == [(False, "the goal is outside its fence", None)]
    assert bench.start._prepared == {}


def test_what_cannot_be_decoded_is_refused_in_the_same_words(bench):
    bench.robots["rex"].decoded = WireError("must be a number", where="data.altitude")
    ((ok, reason, _),) = bench.prepare()
    assert (ok, reason) == (False, str(bench.robots["rex"].decoded))


def test_a_velocity_is_not_started_together(bench):
    bench.robots["rex"].decoded = types.SimpleNamespace(name="velocity")
    assert bench.prepare() == [(False, "a velocity is not started together", None)]


def test_a_start_that_is_taken_back_prepares_nobody(bench):
    bench.prepare()
    bench.start.withdraw()
    with pytest.raises(KeyError):
        bench.start.begin(["rex"], pytest.fail)
    assert bench.begun == []


def test_a_robot_begins_once(bench):
    bench.prepare()
    bench.start.begin(["rex"], pytest.fail)
    bench.start.begin([], pytest.fail)
    assert bench.begun == ["rex"]
