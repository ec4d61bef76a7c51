"""The simulated robot on real buses: what it opens, in whose time it lives, and how it ends."""

import itertools
from types import SimpleNamespace

import pytest

from fleet import CanFrame
from fleet.errors import LinkLost
from fleet.testing.clock import ManualClock
from fleet_quadruped.drives.cia402.frames import SYNC
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.sim import __main__ as module
from fleet_quadruped.sim.dog import SimDog
from fleet_quadruped.sim.selfwalk import SimWalker

WALKER = ["--body", str(EXAMPLE.with_name("self-walking.yaml"))]
BUS = ["--bus", "a=can:virtual:x"]


class OpenBus:
    """A real bus: what was sent on it, and what is received in its first look."""

    opened, heard = [], ()

    def __init__(self, name, url, bitrate, clock, data_bitrate):
        if "bad" in url:
            raise LinkLost("it is not there")
        self.name, self.url, self.bitrates, self.closed = name, url, (bitrate, data_bitrate), False
        self.sent, self._looks = [], 0
        OpenBus.opened.append(self)

    def send(self, frame):
        self.sent.append(frame)

    def receive(self, wait):
        self._looks += 1
        return list(self.heard) if self._looks == 1 else []

    def close(self):
        self.closed = True


class Run:
    """The program, which is ended after some looks at its input; ``steps``: how its machine was advanced."""

    def __init__(self, monkeypatch, capsys):
        self._output, self._looks, self.clock = capsys, 0, ManualClock()
        self.looks, self.pass_time, self.machine, self.steps = 1, lambda look: 0.0, None, []
        monkeypatch.setattr(OpenBus, "opened", [])
        monkeypatch.setattr(module, "OpenCanBus", OpenBus)
        monkeypatch.setattr(module, "SystemClock", lambda: self.clock)
        monkeypatch.setattr(module, "realtime", lambda: True)
        monkeypatch.setattr(module.sys, "stdin", SimpleNamespace(fileno=lambda: 0))
        monkeypatch.setattr(module, "os", SimpleNamespace(read=self._read))
        monkeypatch.setattr(module, "select", SimpleNamespace(select=self._select))
        self._simulated = module.simulated
        monkeypatch.setattr(module, "simulated", self._make)

    def _read(self, number, most):
        return b"x" if self._looks < self.looks else b""

    def _select(self, readers, *_):
        self._looks += 1
        self.clock.advance(self.pass_time(self._looks))
        return readers, [], []

    def _make(self, *arguments):
        self.machine = self._simulated(*arguments)
        advance = self.machine.advance

        def advanced(dt, *, sense):
            self.steps.append((dt, sense))
            advance(dt, sense=sense)

        self.machine.advance = advanced
        return self.machine

    def main(self, *arguments):
        """Run it; return its exit status, its output and its errors."""
        status = module.main([*arguments])
        return status, *self._output.readouterr()


@pytest.fixture
def run(monkeypatch, capsys):
    return Run(monkeypatch, capsys)


def test_a_dog_is_on_the_bus_of_its_description_until_the_input_ends(run):
    assert run.main(*BUS, "--world", "kinematic") == (0, "ready\n", "")
    (bus,) = OpenBus.opened
    assert (bus.name, bus.url, bus.bitrates, bus.closed) == ("a", "can:virtual:x", (1_000_000, None), True)
    assert type(run.machine) is SimDog
    assert {frame.id for frame in bus.sent} == {0x700 + number for number in range(1, 13)}


def test_a_url_may_have_an_equals_sign(run):
    run.main("--bus", "a=can:udp_multicast:239.74.163.2?port=43113", *WALKER)
    assert OpenBus.opened[0].url == "can:udp_multicast:239.74.163.2?port=43113"
    assert type(run.machine) is SimWalker


def test_what_is_received_reaches_the_machine_at_once(run, monkeypatch):
    monkeypatch.setattr(OpenBus, "heard", (CanFrame(0x000, b"\x01\x00"), CanFrame(SYNC, b"")))
    run.main(*BUS, "--world", "kinematic")
    assert len([frame for frame in OpenBus.opened[0].sent if 0x180 < frame.id < 0x190]) == 12


def test_it_keeps_up_with_real_time_in_steps_of_two_milliseconds(run):
    run.looks, run.pass_time = 50, lambda look: 0.0037
    run.main(*BUS, "--world", "kinematic")
    assert {dt for dt, _ in run.steps} == {0.002}
    assert run.machine.time == pytest.approx(49 * 0.0037, abs=0.003)


def test_its_sensors_speak_once_in_a_control_cycle(run):
    run.looks, run.pass_time = 50, lambda look: 0.004
    run.main(*BUS, "--world", "kinematic")
    senses = [number for number, (_, sense) in enumerate(run.steps) if sense]
    assert {later - sooner for sooner, later in itertools.pairwise(senses)} == {5}  # 10 ms


def test_time_that_it_is_late_by_is_dropped_and_said(run, caplog):
    run.looks, run.pass_time = 10, lambda look: 0.25 if look == 2 else 0.004
    run.main(*BUS, "--world", "kinematic")
    assert "the simulated dog is 0.25 s late" in caplog.text
    assert run.machine.time == pytest.approx(8 * 0.004, abs=0.004)  # it goes on at once


def test_a_short_delay_is_made_up_for(run, caplog):
    run.looks, run.pass_time = 4, lambda look: 0.08 if look == 2 else 0.0
    run.main(*BUS, "--world", "kinematic")
    assert run.machine.time == pytest.approx(0.08, abs=0.003)
    assert caplog.text == ""


def test_its_faults_have_begun_when_it_is_ready(run):
    run.main(*BUS, "--world", "kinematic", "--faults", "mute:8,loss:0.5,jump:3")
    assert run.machine.drives[7].hears == {}
    assert run.machine.drives[2].encoder.off == 0.5
    assert run.machine._wires.faults == {"loss": 0.5}


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([*BUS, "--faults", "dream", "--world", "kinematic"], "there is no fault 'dream'"),
        ([*BUS, "--faults", "mute:13", "--world", "kinematic"], "fault mute: 13 is not a valid value"),
        ([*BUS, "--faults", "tip:1", "--world", "kinematic"], "there is no fault 'tip'"),
        ([*BUS, "--body", "/nowhere/rex.yaml"], "/nowhere/rex.yaml: No such file or directory"),
        (["--bus", "z=can:virtual:x"], "'z'"),
        (["--bus", "a=bad"], "it is not there"),
    ],
)
def test_what_cannot_be_is_said(run, arguments, expected):
    status, output, errors = run.main(*arguments)
    assert (status, output) == (1, "")
    assert expected in errors
    assert all(bus.closed for bus in OpenBus.opened)


@pytest.mark.parametrize("arguments", [[], [*BUS, "--world", "marble"]])
def test_wrong_arguments_are_refused_with_the_usage(run, arguments, capsys):
    with pytest.raises(SystemExit, match="2"):
        module.main(arguments)
    assert "fleet_quadruped.sim" in capsys.readouterr().err
