"""The process of the body controller: what it opens, checks, configures, runs and says, and how it ends."""

import signal
import socket
from types import SimpleNamespace

import msgspec
import pytest

from fleet import CanFrame, LinkLost
from fleet.testing.clock import ManualClock
from fleet_quadruped.control import __main__ as module
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.exchange import SharedValue, new_memory
from fleet_quadruped.control.orders import DogState, Order
from fleet_quadruped.control.task import ControlTask
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.selfwalk.controller import SelfWalkController


class Ticking(ManualClock):
    """A clock that goes on by 50 ms whenever it is read."""

    def monotonic(self):
        self.advance(0.05)
        return super().monotonic()


class OpenBus:
    """A real bus, on which ``heard`` is seen; nothing answers."""

    opened = []

    def __init__(self, name, url, bitrate, clock, data_bitrate):
        self.name, self.url, self.bitrates, self.closed, self.sent = (
            name,
            url,
            (bitrate, data_bitrate),
            False,
            [],
        )
        OpenBus.opened.append(self)

    heard = ()

    def send(self, frame):
        self.sent.append(frame)

    def receive(self, wait):
        return list(self.heard)

    def close(self):
        self.closed = True


class Process:
    """What a test gives the process, and what becomes of it: ``loop`` has the arguments of its loop."""

    def __init__(self, monkeypatch, capfdbinary, tmp_path):
        self._output, self.loop, self.ignored = capfdbinary, None, []
        self.memory = [new_memory(), new_memory()]
        self._captures = str(tmp_path / "captures")
        monkeypatch.setattr(module, "ControlLoop", self._looped)
        monkeypatch.setattr(module, "SystemClock", Ticking)
        monkeypatch.setattr(module, "OpenCanBus", OpenBus)
        monkeypatch.setattr(module.logging, "basicConfig", lambda **how: None)
        monkeypatch.setattr(module.signal, "signal", lambda number, how: self.ignored.append((number, how)))
        monkeypatch.setattr(module.sys, "stdin", SimpleNamespace(fileno=lambda: 77))
        monkeypatch.setattr(OpenBus, "opened", [])

    def _looped(self, controller, buses, exchange, clock, **more):
        self.loop = SimpleNamespace(controller=controller, buses=buses, exchange=exchange, **more)
        return SimpleNamespace(run=lambda: None)

    def run(self, **plan):
        """Run the process; return its exit status and what it said."""
        basics = {"body": str(EXAMPLE), "buses": {}, "sim": "kinematic", "faults": {}, "relay": -1}
        order, state = self.memory
        given = ControlTask(**basics | {"order": order, "state": state, "captures": self._captures} | plan)
        status = module.main([msgspec.json.encode(given).decode()])
        return status, [msgspec.json.decode(line) for line in self._output.readouterr().out.splitlines()]


@pytest.fixture
def process(monkeypatch, capfdbinary, tmp_path):
    return Process(monkeypatch, capfdbinary, tmp_path)


@pytest.fixture
def mit(write_dog):
    """Return the description of a dog that is configured quickly."""
    return str(write_dog(("protocol: cia402", "protocol: mit\n  profile: damiao-8006")))


@pytest.mark.parametrize(("name", "kind"), [("mit", Controller), ("self-walking", SelfWalkController)])
def test_a_simulated_machine_is_run_by_the_controller_of_its_kind(process, mit, name, kind):
    body = mit if name == "mit" else str(EXAMPLE.with_name(f"{name}.yaml"))
    assert process.run(body=body) == (0, [{"ready": True}])
    assert type(process.loop.controller) is kind
    assert (process.loop.owner, process.loop.relay, set(process.loop.buses)) == (77, None, {"a"})
    before = process.loop.moved.__self__.time
    process.loop.moved(0.01)
    assert process.loop.moved.__self__.time == pytest.approx(before + 0.01)


def test_it_leaves_signals_of_a_terminal_to_its_parent(process, mit):
    process.run(body=mit)
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)
    assert process.ignored == [(number, signal.SIG_IGN) for number in numbers]


def test_orders_and_states_go_through_the_memory_of_the_plan(process, mit):
    process.run(body=mit)
    orders, states = SharedValue(process.memory[0], Order), SharedValue(process.memory[1], DogState)
    orders.put(Order(x=0.3))
    assert process.loop.exchange.order().x == 0.3
    process.loop.exchange.put(DogState(mode="standing"))
    assert states.get().mode == "standing"


def test_the_faults_of_the_plan_are_those_of_the_machine(process, mit):
    status, ((said),) = process.run(body=mit, faults={"mute": 8.0})
    assert (status, said) == (
        1,
        {"lost": "RL_hip: id 8 on bus 'a' is silent; check power, wiring, id"},
    )
    assert process.loop is None


@pytest.mark.parametrize(
    ("plan", "expected"),
    [
        ({"faults": {"dream": 1.0}}, "dream"),
        ({"faults": {"mute": 13.0}}, "fault mute: 13 is not a valid value"),
        ({"body": "/nowhere/rex.yaml"}, "/nowhere/rex.yaml: No such file or directory"),
        ({"sim": "marble"}, "marble"),
    ],
)
def test_what_cannot_be_is_refused_in_words(process, plan, expected):
    status, (said,) = process.run(**plan)
    assert status == 1
    assert expected in said["refused"]


def test_a_real_bus_is_opened_as_it_is_described_and_closed_at_the_end(process):
    status, (said,) = process.run(
        sim="", buses={"a": "can:socketcan:can0"}, body=str(EXAMPLE.with_name("self-walking.yaml"))
    )
    (bus,) = OpenBus.opened
    assert (status, said, bus.closed) == (0, {"ready": True}, True)
    assert (bus.url, bus.bitrates) == ("can:socketcan:can0", (500_000, None))
    assert process.loop.moved is None


def test_nothing_is_sent_on_a_bus_with_another_controller(process, mit, monkeypatch):
    monkeypatch.setattr(OpenBus, "heard", (CanFrame(0x001, bytes(8)),))
    status, (said,) = process.run(sim="", buses={"a": "can:socketcan:can0"}, body=mit)
    (bus,) = OpenBus.opened
    assert status == 1
    assert "another controller commands the drives (frame 001h)" in said["lost"]
    assert (bus.sent, bus.closed) == ([], True)


def test_buses_are_closed_when_the_link_is_lost_before_it_is_ready(process, mit, monkeypatch):
    def gone(*_):
        raise LinkLost("bus 'a' is gone")

    monkeypatch.setattr(module, "require_sole_controller", gone)
    assert process.run(sim="", buses={"a": "can:socketcan:can0"}, body=mit) == (
        1,
        [{"lost": "bus 'a' is gone"}],
    )
    assert OpenBus.opened[0].closed


def test_frames_are_relayed_to_the_socket_of_the_plan(process, mit):
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours:
        process.run(body=mit, relay=theirs.detach())
        assert process.loop.relay is not None
        assert ours.recv(1) == b"", "it is closed at the end"
