"""No stop is lost: whatever its payload holds, whichever way it comes, whatever state the robot is in."""

import asyncio
import json
import logging
import threading
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.bridge import downlink
from fleet.bus import keys
from fleet.bus.zenoh_session import keys_intersect
from fleet.cloud.values import CloudMessage
from fleet.host.journal.execution_journal import Latched
from fleet.host.journal.journal import RobotJournal
from fleet.host.process.robot_process import RobotProcess, RobotSpec
from fleet.host.process.stop_service import serve_stops
from fleet.host.requests.stop_cause import STOP_KEY_CAUSE, local_cause
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.runtime import threads
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.model.geometry import Velocity
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.testing.clock import ManualClock
from fleet.testing.robot import RecordingRobot
from fleet.wire.rulebook import rulebook, twin_rules
from fleet.wire.topics import Topics
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
US = "fleet_us"
T = f"cyberwave/twin/{TWIN}"
HANGS = 20.0  # s that a journal which is blocked stays so, unless it is freed


class Question:
    """A query for one robot."""

    def __init__(self, requested, payload, parameters, reply, close, *, suffix=""):
        self.key = self.requested = requested
        self.payload, self.parameters, self.suffix = payload, parameters, suffix
        self.reply, self.close = reply, close

    def split(self, keys):
        """Return the question for each key: there is at most one."""
        for self.key in keys:
            yield self


class FakeSession:
    """The bus of one computer, in memory: whoever asks and publishes is served at once."""

    def __init__(self):
        self.takers, self.heard = [], []

    def __getattr__(self, _name):
        return lambda *_arguments, **_options: lambda: None

    def publishers(self, _pattern):
        return SimpleNamespace(wanted=lambda _key: None)

    def subscribe_noted(self, key, call):
        self.heard.append((key, call))

    def declare_queryable(self, key, call, **_options):
        self.takers.append((key, call))
        return lambda: None

    def put(self, key, payload, *, urgent=False, note=b""):
        for declared, call in self.heard:
            if key in (declared, declared.replace("yard", "*")):
                call(payload, note)

    def request(self, key, payload, *, suffix="", **parameters):
        """Ask; return what was answered, which may come later."""
        answers = []
        self._pass_on(Question(key, payload, parameters, answers.append, lambda: None, suffix=suffix))
        return answers

    def request_later(self, key, payload, *, timeout, parameters, on_answer, on_end):
        self._pass_on(Question(key, payload, parameters, on_answer, on_end))

    def _pass_on(self, question):
        """Give a question to those who declared its key, or a pattern of it, as Zenoh does."""
        for declared, call in self.takers:
            if keys_intersect(declared, question.requested):
                question.key = declared
                call(question)


class FakeJournal:
    """A journal that remembers nothing, and may block."""

    def __init__(self):
        self.blocked, self.free, self.latched = False, threading.Event(), []
        self.problem = ""

    def robot(self, name):
        return RobotJournal(name, self._put, clock=ManualClock())

    def _put(self, change):
        if isinstance(change, Latched):
            if self.blocked:
                self.free.wait(HANGS)
            self.latched.append(change)


class Rig:
    """One robot and all the ways to it; with ``worker`` it runs in one, behind the edge's side of it."""

    def __init__(self, adapter_class, *, worker):
        self.clock, self.bus_session, self.journal = ManualClock(), FakeSession(), FakeJournal()
        self.write = lambda: None  # what the history does with an event
        self.config = adapter_class.Config(name="rex", twin=TWIN)
        loop = asyncio.get_running_loop()
        self.process = RobotProcess(
            "yard",
            SimpleNamespace(
                control=self.bus_session, reports=self.bus_session, consoles=frozenset(), people={}
            ),
            [RobotSpec(self.config, adapter_class, "puppet")],
            journal=self.journal,
            history=SimpleNamespace(add=lambda _robot, _event: self.write()),
            clock=self.clock,
            alone=not worker,
        )
        self.robot: LocalRobot = self.process.robots["rex"]
        self.adapter = adapter_class(self.config, RecordingRobot())
        self.robot.controller.attach(self.adapter)
        self.robot.controller.found()
        self.process._show(self.robot)
        port = self.robot
        if worker:
            port = RemoteRobot(
                self.config,
                adapter="puppet",
                edge="yard",
                control=self.bus_session,
                clock=self.clock,
                soon=loop.call_soon_threadsafe,
                arrival=self.clock.monotonic,
                worker="w",
                publish=lambda _report: None,
            )
        serve_stops(self.process, SimpleNamespace(control=self.bus_session, reports=self.bus_session), {}, ())
        self.downlink = downlink.Downlink(
            Topics(""),
            {TWIN: port},
            books={TWIN: twin_rules(rulebook())},
            session=US,
            send=lambda *_, **__: None,
            put=lambda *_: None,
            own={},
            refusals=RateLimitedCounter(logging.getLogger("rig"), self.clock),
            clock=self.clock,
        )

    def over_mqtt(self, suffix, payload, **properties):
        self.downlink.arrived([CloudMessage(f"{T}/{suffix}", payload, **properties)])
        self.downlink.dispatch()

    def over_the_bus(self, payload, **parameters):
        self.bus_session.request(keys.command("yard", "rex"), payload, **parameters)


TRANSPORTS = {
    "mqtt command": lambda rig, payload: rig.over_mqtt("command", payload),
    "mqtt command, kept": lambda rig, payload: rig.over_mqtt("command", payload, retain=True),
    "mqtt command, damaged": lambda rig, payload: rig.over_mqtt("command", payload, flaw="no UTF-8"),
    "mqtt navigation": lambda rig, payload: rig.over_mqtt("navigate/command", payload),
    "mqtt mission": lambda rig, payload: rig.over_mqtt("mission/command", payload),
    "bus command": lambda rig, payload: rig.over_the_bus(payload),
    "bus, a console that may look": lambda rig, payload: rig.over_the_bus(payload, suffix="/as/view/screen"),
    "bus, no such console": lambda rig, payload: rig.over_the_bus(payload, suffix="/as/god/"),
    "bus of no kind": lambda rig, payload: rig.over_the_bus(payload, kind="dance", way="cloud"),
    "stop key": lambda rig, payload: rig.bus_session.put("fleet/*/stop", payload, urgent=True),
}
SMALL = {
    "mqtt velocity": lambda rig, payload: rig.over_mqtt("motion/command", payload),
    "bus velocity kind": lambda rig, payload: rig.over_the_bus(payload, kind="motion"),
}
"""Ways of velocities: what is too large to be read is refused there, and the velocity's lease ends."""


def drive(rig, session="bert"):
    message = {"command": "move_forward", "source_type": "tele", "session_id": session, "data": {}}
    rig.robot.read("command", json.dumps(message).encode(), transport="cloud")(lambda _: None)


def fly(rig):
    rig.robot.read("command", b'{"command": "takeoff", "source_type": "tele"}', transport="cloud")(
        lambda _: None
    )


def block(rig):
    rig.journal.blocked = True


def hold(rig):
    rig.downlink.held = {TWIN: "yard-0"}


STATES = {
    "idle": lambda _: None,
    "led by another": drive,
    "flying": fly,
    "latched": lambda rig: rig.robot.controller.emergency("before"),
    "held elsewhere": hold,
    "at fault": lambda rig: rig.robot.controller.faulted("motor 3"),
    "journal blocked": block,
    "inbox full": lambda rig: rig.downlink.arrived([CloudMessage(f"{T}/command", b"{}")] * 3),
}

JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5) | st.just(US),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
FIELDS = st.sampled_from(["timestamp", "ts", "source_type", "session_id", "data", "action_id", "x"])
NAMES = st.sampled_from(["stop", "emergency_stop", "estop", "hover", "brake", "STOP", "E-Stop", " Stop"])
EMERGENCIES = {"emergency_stop", "estop", "E-Stop"}


def fail():
    raise OSError("no history")


FAULTS = {
    "the history refuses": lambda rig: setattr(rig, "write", fail),
    "the recorder has no clock": lambda rig: setattr(rig.robot._recorder, "_clock", None),
    "the recorder has no way out": lambda rig: setattr(rig.robot._recorder, "_put", None),
}
"""What may be wrong with the record of a stop."""


@st.composite
def stops(draw):
    """Return a payload that names a stop, and the name."""
    name = draw(NAMES)
    trimmings = draw(st.dictionaries(FIELDS, JSON, max_size=5))
    if name == "estop":
        trimmings.pop("data", None)  # which may make a release of it
    text = json.dumps({draw(st.sampled_from(["command", "type"])): name, **trimmings})
    how = draw(st.sampled_from(["whole", "cut", "twice", "list", "quotes", "utf-16", "utf-8-sig", "latin"]))
    head = text.index(name) + len(name)
    return {
        "whole": text.encode,
        "cut": lambda: text.encode()[: draw(st.integers(head, len(text)))],
        "twice": lambda: b'{"command": "takeoff", ' + text[1:].encode(),
        "list": lambda: b"[" + text.encode() + b"]",
        "quotes": lambda: text.replace('"', "'").encode(),
        "utf-16": lambda: text.encode("utf-16"),
        "utf-8-sig": lambda: text.encode("utf-8-sig"),
        "latin": lambda: text.encode() + b"\xff\xfe",
    }[how](), name


def moves(calls):
    return [one for one in calls if isinstance(one, tuple) or (isinstance(one, Velocity) and not one.is_zero)]


async def come(adapter_class, transport, state, payload, *, worker):
    """Let a stop come; return the rig and what the robot was told since."""
    rig = Rig(adapter_class, worker=worker)
    STATES[state](rig)
    await asyncio.sleep(0)
    before = len(rig.adapter.calls)
    transport(rig, payload)
    for _ in range(12):
        await asyncio.sleep(0)
    calls = rig.adapter.calls[before:]
    rig.journal.free.set()
    await threads_ended()
    return rig, calls


async def threads_ended():
    """Wait for the threads of a stop: what they still ask of the loop would come to a closed one."""
    for one in threading.enumerate():
        if one.name == threads.NAME:
            one.join(HANGS)
    for _ in range(12):
        await asyncio.sleep(0)


@pytest.fixture
def adapter_class(bench):
    """Return the class of a robot that writes down what it is told."""
    return type(bench.adapter)


@pytest.fixture(autouse=True)
def _a_small_inbox(monkeypatch):
    monkeypatch.setattr(downlink, "MOST_WAITING", 3)


PLAYED = settings(max_examples=100, deadline=None)


@pytest.mark.parametrize("worker", [False, True], ids=["here", "in a worker"])
def test_a_stop_is_obeyed_whatever_it_holds_however_it_comes_and_whatever_there_is(
    adapter_class, caplog, worker
):
    caplog.set_level(logging.CRITICAL)

    @PLAYED
    @given(st.sampled_from(sorted(TRANSPORTS | SMALL)), st.sampled_from(sorted(STATES)), stops())
    def holds(transport, state, stop):
        payload, name = stop
        with asyncio.Runner() as runner:
            rig, calls = runner.run(
                come(adapter_class, (TRANSPORTS | SMALL)[transport], state, payload, worker=worker)
            )
        assert {"stop", "halt"} & set(calls)
        assert not moves(calls)
        if name in EMERGENCIES or transport == "stop key":
            assert rig.robot.controller.latched
            assert "halt" in calls

    holds()


@pytest.mark.combinations
@pytest.mark.parametrize("worker", [False, True], ids=["here", "in a worker"])
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_what_is_too_large_to_be_read_is_a_stop_where_stops_come(
    adapter_class, caplog, transport, state, worker
):
    caplog.set_level(logging.CRITICAL)
    payload = b'{"command": "takeoff", "x": "' + b"x" * (2 << 20)
    with asyncio.Runner() as runner:
        rig, calls = runner.run(come(adapter_class, TRANSPORTS[transport], state, payload, worker=worker))
    if transport == "bus of no kind":  # nothing says what it is about
        return
    assert {"stop", "halt"} & set(calls)
    assert not moves(calls)
    assert rig.robot.controller.latched or transport in ("mqtt navigation", "mqtt mission")


@pytest.mark.parametrize("sender", ["tele", "edge", "sim", "preview", "edit", "nobody knows", "", None])
@pytest.mark.parametrize("name", ["stop", "emergency_stop"])
def test_whoever_is_let_in_may_stop_and_only_who_is_obeyed_may_release(adapter_class, sender, name):
    async def play():
        rig = Rig(adapter_class, worker=False)
        drive(rig)
        answers = []
        for word in (name, "release_emergency_stop"):
            message = json.dumps({"command": word, "source_type": sender}).encode()
            rig.robot.read("command", message, transport="cloud")(answers.append)
            for _ in range(10):
                await asyncio.sleep(0)
        return rig, answers

    with asyncio.Runner() as runner:
        rig, (stopped, released) = runner.run(play())
    assert stopped.ok
    assert released.ok == (sender == "tele")
    assert rig.robot.controller.latched == (name == "emergency_stop" and not released.ok)


def test_a_stop_whose_message_is_refused_is_reported_both(adapter_class):
    async def play():
        rig, answers = Rig(adapter_class, worker=False), []
        rig.robot.read("command", b'{"command": "stop", "data": {', transport="bus")(answers.append)
        for _ in range(10):
            await asyncio.sleep(0)
        return answers

    with asyncio.Runner() as runner:
        (answer,) = runner.run(play())
    assert (answer.command, answer.ok) == ("stop", True)
    assert answer.reason.startswith("taken for stop, though the message was refused: ")


def test_a_journal_that_hangs_keeps_no_robot_from_being_halted(adapter_class):
    async def play():
        rig = Rig(adapter_class, worker=False)
        rig.journal.blocked = True
        await asyncio.to_thread(rig.process.stop_robots, (), STOP_KEY_CAUSE)
        calls, latched = list(rig.adapter.calls), list(rig.journal.latched)
        rig.journal.free.set()
        return rig, calls, latched

    with asyncio.Runner() as runner:
        rig, calls, latched = runner.run(play())
    assert "halt" in calls
    assert rig.robot.controller.latched
    assert latched == []
    wait_until("it is recorded", lambda: [change.why for change in rig.journal.latched] == ["the stop key"])


def test_two_stops_go_on_though_one_robot_is_not_written(adapter_class):
    async def play():
        rig = Rig(adapter_class, worker=False)
        drive(rig)
        FAULTS["the recorder has no clock"](rig)
        rig.process.robots = {"first": rig.robot, "second": rig.robot}
        stopped = rig.process.stop_robots((), local_cause("anna", request="r1"))
        for _ in range(12):
            await asyncio.sleep(0)
        return rig, stopped

    with asyncio.Runner() as runner:
        rig, stopped = runner.run(play())
    assert len(stopped) == 2
    assert "stop" in rig.adapter.calls


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", ["stop", "emergency_stop"])
@pytest.mark.parametrize("transport", ["mqtt command", "bus command", "stop key"])
def test_a_stop_does_not_depend_on_its_record(adapter_class, caplog, transport, name, fault):
    async def play():
        rig, answers = Rig(adapter_class, worker=False), []
        drive(rig)
        FAULTS[fault](rig)
        before = len(rig.adapter.calls)
        message = {"command": name, "source_type": "tele", "session_id": "anna", "id": "r1"}
        if transport == "bus command":
            answers = rig.bus_session.request(keys.command("yard", "rex"), json.dumps(message).encode())
        else:
            TRANSPORTS[transport](rig, json.dumps(message).encode())
        for _ in range(12):
            await asyncio.sleep(0)
        return rig, rig.adapter.calls[before:], answers

    with asyncio.Runner() as runner:
        rig, calls, answers = runner.run(play())
    assert "stop" in calls
    assert not moves(calls)
    assert rig.robot.controller.latched == (name == "emergency_stop" or transport == "stop key")
    assert "could not be written into the history" in caplog.text
    assert (transport == "bus command") == bool(answers)
