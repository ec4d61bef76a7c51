"""A pair of edges with a moving robot: the edge that has the lease is killed, frozen or cut off.

What counts is what the robot heard: its base, a process of its own, writes down each byte with its time, and
by which of its two ports it came; each edge knows one of them.
"""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import psutil
import pytest

from fleet.bus import keys
from fleet.bus.bus import join_control
from fleet.bus.settings import BusSettings
from fleet.errors import BusError
from fleet.model.command import Reply
from fleet.model.state import EdgeState, RobotState
from fleet.runtime.decoding import decode_json
from tests.tools.command_line import command_line, own_folders
from tests.tools.lease_service import lease_service
from tests.tools.ports import free_ports
from tests.tools.proxy import TcpProxy
from tests.tools.waiting import wait_until

ROUNDS, SOAK_ROUNDS = 2, 50  # two: each edge once
TAKEN_WITHIN = 6.0  # s in which the standby hears the robot
BOUND = 0.5 + 0.5  # s: setpoint lease and the board's own stop
MOVE = b'{"command": "move_forward", "data": {"linear_x": 0.3}, "source_type": "tele"}'
RELEASE = b'{"command": "release_emergency_stop", "source_type": "tele"}'
EMERGENCY_STOP = b'{"command": "emergency_stop"}'


@dataclass
class Heard:
    """Bytes that the robot heard: when (monotonic s), by which edge's port, and what."""

    at: float
    edge: str
    data: bytes

    @cached_property
    def moves(self):
        """Whether one of the lines turns a wheel."""
        lines = [json.loads(line) for line in self.data.splitlines() if line.endswith(b"}")]
        return any(line.get("T") == 1 and (line["L"] or line["R"]) for line in lines)


class Computer:
    """One computer of the pair: its folders, its way to the lease service, its ``fleet run``."""

    def __init__(self, name, file, port, lease_port, buses):
        self.name, self.file = name, file
        own, other = buses if name == "a" else reversed(buses)
        self.runtime = Path(tempfile.mkdtemp())
        self.proxy = TcpProxy(lease_port)
        self._environment = {
            **os.environ,
            **own_folders(str(self.runtime)),
            "ROBOT_PORT": str(port),
            "BUS_PORT": str(own),
            "OTHER_BUS_PORT": str(other),
        }
        self.run = None
        self._bus = None

    def start(self):
        """Start the edge."""
        self.log = (self.runtime / "log").open("a")
        environment = self._environment | {"LEASE_PORT": str(self.proxy.port)}
        self.run = subprocess.Popen(
            [sys.executable, "-m", "fleet", "run", "--edge-id", self.name, "-v", str(self.file)],
            env=environment,
            stdout=self.log,
            stderr=self.log,
        )

    def call(self, *arguments):
        """Run another ``fleet`` command on this computer."""
        return command_line(str(self.runtime), *arguments)

    @property
    def processes(self):
        """The supervisor and its edge."""
        supervisor = psutil.Process(self.run.pid)
        return [supervisor, *supervisor.children()]

    def request(self, key, payload=b"", kind=None):
        """Ask the edge something; the answer as ``kind``, None when there is none."""
        with contextlib.suppress(BusError):
            bus = self._bus  # another thread may leave the bus meanwhile
            if bus is None:
                bus = self._bus = join_control(BusSettings(self.name), self.runtime)
            answers = bus.request(key, payload, timeout=2.0)
            return next((decode_json(data, kind) for _, data in answers), None)
        return None

    @property
    def state(self):
        """The edge's own state."""
        return self.request(keys.health(self.name), kind=EdgeState)

    @property
    def robot(self):
        """The robot's state; waited for, because a busy computer is slow to answer."""
        key = keys.state(self.name, "rover")
        return wait_until(f"edge {self.name} answers", lambda: self.request(key, kind=RobotState))

    def command(self, payload):
        """Ask something of the robot; None where nobody answers."""
        return self.request(keys.command(self.name, "rover"), payload, Reply)

    def has_role(self, role):
        """Return whether the edge is in this role."""
        state = self.state
        return state is not None and state.pair == role

    def signal(self, number):
        """Signal the edge, and its supervisor before it: the whole computer freezes and goes on."""
        for process in self.processes:
            process.send_signal(number)

    def forget_bus(self):
        """Leave the bus of an edge that has ended."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.close()

    def end(self):
        """End the edge."""
        self.forget_bus()
        if self.run is not None:
            with contextlib.suppress(psutil.NoSuchProcess):
                self.signal(signal.SIGCONT)
            self.run.terminate()
            try:
                self.run.wait(20)
            except subprocess.TimeoutExpired:
                for process in self.processes:
                    process.kill()
                self.run.wait(20)
            self.log.close()


class Pair:
    """Two computers, a robot that both can open, and somebody who drives it all the time."""

    def __init__(self, computers, record):
        self.computers = {each.name: each for each in computers}
        self._record, self._heard = record.open(), []
        self._drives = threading.Event()
        self._driver = threading.Thread(target=self._drive, daemon=True)
        self._driver.start()

    def received(self, since=0.0):
        """Return what the robot heard; each line of its record is read once."""
        for line in self._record:
            at, port, data = line.split()
            self._heard.append(Heard(float(at), "ab"[int(port)], bytes.fromhex(data)))
        return [each for each in self._heard if each.at >= since]

    def _drive(self):
        """Ask both edges to drive, whoever of them has the robot."""
        while not self._drives.is_set():
            for computer in self.computers.values():
                if computer.run is not None and computer.drivable:
                    with contextlib.suppress(Exception):  # its bus was closed meanwhile; it is asked again
                        computer.command(MOVE)
            self._drives.wait(0.15)

    def moving(self, edge, since):
        """Return whether an edge has moved the robot."""
        return any(each.moves and each.edge == edge for each in self.received(since))

    def end(self):
        self._drives.set()
        self._driver.join(10)
        self._record.close()
        for computer in self.computers.values():
            computer.end()


@pytest.fixture(scope="module")
def lease_port(tmp_path_factory):
    """Run a lease service; its port."""
    with lease_service(tmp_path_factory.mktemp("lease")) as port:
        yield port


@pytest.fixture(scope="module")
def pair(tmp_path_factory, lease_port):
    """Run both edges, until one has the lease and drives the robot."""
    folder = tmp_path_factory.mktemp("pair")
    record = folder / "heard"
    record.touch()
    base = subprocess.Popen(
        [sys.executable, "-m", "tests.tools.tcp_base", str(record), "2"], stdout=subprocess.PIPE, text=True
    )
    ports = base.stdout.readline().split()
    file = folder / "fleet.yaml"
    robot = {
        "name": "rover",
        "twin": str(uuid.uuid4()),
        "adapter": "ugv",
        "profile": "waveshare-rover",
        "link": "tcp:127.0.0.1:${ROBOT_PORT}",
    }
    bus = {
        "listen": ["tcp/127.0.0.1:${BUS_PORT}"],
        "connect": ["tcp/127.0.0.1:${OTHER_BUS_PORT}"],
        "insecure": "local",
    }
    lease = {"servers": ["nats://127.0.0.1:${LEASE_PORT}"]}
    file.write_text(json.dumps({"pair": ["a", "b"], "lease": lease, "bus": bus, "robots": [robot]}))
    buses = free_ports(2)
    computers = [
        Computer(name, file, port, lease_port, buses) for name, port in zip("ab", ports, strict=True)
    ]
    with contextlib.ExitStack() as stack:
        stack.callback(base.wait, 20)
        stack.callback(base.terminate)
        for computer in computers:
            computer.drivable = True
            stack.enter_context(computer.proxy)
        pair = Pair(computers, record)
        stack.callback(pair.end)
        computers[0].start()
        wait_until("edge a has the lease", lambda: computers[0].has_role("holder"))
        computers[1].start()
        wait_until("edge b is standby", lambda: computers[1].has_role("standby"))
        yield pair
    for computer in computers:
        sys.stdout.write((computer.runtime / "log").read_text())  # shown where a test fails
        shutil.rmtree(computer.runtime)
    base.stdout.close()


def rounds(request):
    """Return how often the holder is lost."""
    return SOAK_ROUNDS if request.config.getoption("--soak") else ROUNDS


def holder_and_standby(pair):
    """Wait until one edge has the lease and the other is standby; return them."""
    by_role = {}

    def found():
        states = {computer: computer.state for computer in pair.computers.values()}
        by_role.update({state.pair: computer for computer, state in states.items() if state is not None})
        return all(states.values()) and {state.pair for state in states.values()} == {"holder", "standby"}

    wait_until("one edge holds the lease and the other is standby", found)
    return by_role["holder"], by_role["standby"]


def ready(pair):
    """Wait until one edge drives the robot and the other is standby; return holder and standby.

    A busy computer may lose its lease at any moment: then the edges have changed places.
    """
    return wait_until("an edge keeps the lease and drives the robot", lambda: driving(pair))


def driving(pair):
    """Return holder and standby once the holder drives the robot; None if it loses its lease meanwhile."""
    holder, other = holder_and_standby(pair)

    def wait_for(what, holds):
        wait_until(what, lambda: holds() or not holder.has_role("holder"))

    wait_for("the robot is heard", lambda: holder.robot.reachable)
    wait_for("the standby has seen the lease", lambda: "has the lease" in other.robot.cause)
    if holder.robot.emergency_stop:
        wait_for("it is released", lambda: (said := holder.command(RELEASE)) and said.ok)
        wait_for("the standby follows the release", lambda: not other.robot.emergency_stop)
    since = time.monotonic()
    wait_for("the robot moves", lambda: pair.moving(holder.name, since))
    return (holder, other) if holder.has_role("holder") else None


def took_over(pair, holder, other, lost_at, *, in_flight=0):
    """Check by the robot's wire that the other edge took over in time, and that the two never mixed.

    ``in_flight`` halts may come late: a process that was frozen between the gate's check and the write of a
    frame writes that one when it goes on (ADR 0022).
    """
    wait_until("the other edge moves the robot", lambda: pair.moving(other.name, lost_at))
    received = pair.received(lost_at)
    first = next(each for each in received if each.edge == other.name)
    assert first.at - lost_at <= TAKEN_WITHIN
    late = [each for each in received if each.edge == holder.name and each.at >= first.at]
    assert not any(each.moves for each in late)
    assert len(late) <= in_flight
    before = [
        each for each in pair.received() if each.edge == holder.name and each.moves and each.at < first.at
    ]
    moved = next(each for each in received if each.edge == other.name and each.moves)
    assert moved.at - before[-1].at >= BOUND
    return first


def test_a_killed_edge_is_replaced(pair, request):
    for _ in range(rounds(request)):
        holder, other = ready(pair)
        (edge,) = holder.processes[1:]
        lost_at = time.monotonic()
        edge.kill()
        holder.forget_bus()
        took_over(pair, holder, other, lost_at)


def test_a_frozen_edge_writes_nothing_when_it_goes_on(pair, request):
    for number in range(rounds(request)):
        holder, other = ready(pair)
        frozen = holder.processes[number % 2 :]  # the whole computer, or the edge alone
        lost_at = time.monotonic()
        holder.drivable = False
        for process in frozen:
            process.send_signal(signal.SIGSTOP)
        took_over(pair, holder, other, lost_at)
        for process in frozen:
            with contextlib.suppress(psutil.NoSuchProcess):  # its supervisor has killed it meanwhile
                process.send_signal(signal.SIGCONT)
        holder.forget_bus()
        holder.drivable = True
        wait_until("it knows that its lease is gone", partial(holder.has_role, "standby"))
        took_over(pair, holder, other, lost_at, in_flight=1)


def test_an_edge_that_is_cut_off_from_the_lease_stops_the_robot_before_the_other_has_it(pair, request):
    for _ in range(rounds(request)):
        holder, other = ready(pair)
        lost_at = time.monotonic()
        holder.proxy.blackhole = True
        took_over(pair, holder, other, lost_at)
        holder.proxy.blackhole = False
        holder.proxy.reset()


def test_an_emergency_stop_is_set_on_the_other_edge_too(pair):
    holder, other = ready(pair)
    # A busy computer may lose its lease at any moment, and answers then that the robot is out of reach: the
    # stop is set all the same, and the edges may have changed places.
    wait_until("it is answered", lambda: holder.command(EMERGENCY_STOP))
    wait_until("both have it", lambda: holder.robot.emergency_stop and other.robot.emergency_stop)
    holder, other = holder_and_standby(pair)
    (edge,) = holder.processes[1:]
    lost_at = time.monotonic()
    edge.kill()
    holder.forget_bus()
    wait_until("the other edge hears the robot", lambda: other.has_role("holder") and other.robot.reachable)
    refused = other.command(MOVE)
    assert "emergency stop is set (set at edge" in refused.reason
    assert not pair.moving(other.name, lost_at)


def handed_over(pair):
    """Hand the robot over; None if the holder lost its lease before it was asked (see ``ready``)."""
    holder, other = ready(pair)
    requested_at = time.monotonic()
    said = holder.call("failover")
    return None if "is standby" in said.stderr else (holder, other, requested_at, said)


def test_a_handover_holds_the_robot_and_is_quick(pair):
    holder, other, requested_at, said = wait_until("the holder is asked", lambda: handed_over(pair))
    assert said.returncode == 0, said.stderr
    assert f"edge {holder.name} has released its robots" in said.stdout
    first = took_over(pair, holder, other, requested_at)
    last = max((each for each in pair.received() if each.edge == holder.name), key=lambda each: each.at)
    assert not last.moves
    assert first.at > last.at


def test_no_edge_takes_over_with_another_file_until_a_person_accepts_it(pair):
    holder, other = ready(pair)
    kept = other.file
    other.end()
    fleet = json.loads(kept.read_text())
    fleet["robots"][0]["limits"] = {"speed": 0.2}
    other.file = kept.with_name("other.yaml")
    other.file.write_text(json.dumps(fleet))
    other.start()
    wait_until("it is told", lambda: "another file: no takeover" in other.robot.cause)
    holder.end()
    assert other.has_role("standby"), "the lease was given back in order"
    said = other.call("failover", other.name, "--accept-file")
    assert said.returncode == 0, said.stderr
    wait_until("it has the robots", lambda: other.has_role("holder"))
    said = other.call("failover", other.name, "--accept-file")
    assert said.returncode != 0, "it was asked once more, and hands nothing over"
    assert "is not blocked by a different file" in said.stdout + said.stderr
    assert other.has_role("holder")
    other.end()
    other.file = kept
    for computer in (other, holder):
        computer.start()
    ready(pair)


def test_a_name_means_the_robot_of_the_edge_that_has_it(pair):
    holder, other = ready(pair)
    for computer in (holder, other):
        said = computer.call("describe", "rover")
        assert said.returncode == 0, said.stderr
