"""The dog in a process of its own, reached over CAN on UDP multicast: nothing is shared but frames."""

import contextlib
import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import time

import can
import pytest

from fleet import Fault, LinkLost, NotReady, TimedOut, Vector3, Velocity
from fleet_quadruped.drives.cia402.frames import SYNC, TPDO1, unpack_status_pdo
from fleet_quadruped.drives.cia402.states import DriveState, state_of
from tests.tools.waiting import DEADLINE

pytestmark = pytest.mark.real_time
TRIES = 3
"""Where a computer stalls its drives answer late, and the dog gives way, as it must: once more."""


@contextlib.contextmanager
def _on_a_bus(*options):
    """Give the URL of a multicast group of our own, with a simulated dog on it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    url = f"can:udp_multicast:239.74.{port >> 8}.{port & 255}?port={port}"
    command = [sys.executable, "-m", "fleet_quadruped.sim", "--world", "kinematic", "--bus", f"a={url}"]
    command += options
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as sim:
        assert sim.stdout.readline() == b"ready\n"
        yield url
        sim.stdin.close()


def states(url):
    """Ask all drives; return their states."""
    _, _, group, port = url.replace("?port=", ":").split(":")
    with can.Bus(interface="udp_multicast", channel=group, port=int(port), fd=False, hop_limit=0) as watcher:
        question = can.Message(arbitration_id=SYNC, is_extended_id=False)
        seen, deadline = {}, time.monotonic() + DEADLINE
        watcher.send(question)
        while len(seen) < 12:
            message = watcher.recv(2.0)
            assert time.monotonic() < deadline, f"only {len(seen)} drives answered"
            if message is None:  # a busy computer may lose a datagram
                watcher.send(question)
            elif TPDO1 < message.arbitration_id <= TPDO1 + 12:
                seen[message.arbitration_id] = state_of(unpack_status_pdo(bytes(message.data)).status)
    return set(seen.values())


async def test_it_stands_and_walks_over_the_bus_and_its_drives_stop_when_the_controller_is_killed(running):
    faults = []
    while len(faults) < TRIES:
        with _on_a_bus() as bus:
            try:
                await _walk_and_kill(running, bus)
            except (Fault, NotReady, TimedOut) as fault:
                faults.append(str(fault))
            else:
                return
    pytest.fail(str(faults))


async def _walk_and_kill(running, bus):
    """Have a dog walk, kill its controller and see its drives stop; raises Fault where they answer late."""
    async with running(link=None, buses={"a": bus}) as (adapter, robot, run):
        async for _ in adapter.stand_up():
            pass
        adapter.drive(Velocity(Vector3(0.4)))
        await robot.until(
            lambda: adapter._body.state.x > 0.1 or run.done() or adapter._body.state.mode == "damped"
        )
        if run.done() or adapter._body.state.mode == "damped":
            raise Fault(adapter._body.state.fault)
        assert states(bus) == {DriveState.ENABLED}
        os.kill(adapter._body.process.pid, signal.SIGKILL)
        with pytest.raises(LinkLost):
            await run
        assert _stopped(bus) == {DriveState.QUICK_STOP}
    async with running(link=None, buses={"a": bus}) as (adapter, robot, _):
        await robot.until(lambda: adapter._body.state.mode == "damped")
        await robot.until(lambda: adapter._body.state.mode == "off")
        assert _stopped(bus) == {DriveState.SWITCH_ON_DISABLED}
        async for _ in adapter.stand_up():
            pass
    assert states(bus) == {DriveState.SWITCH_ON_DISABLED}, "whoever leaves a standing dog takes torque off"


def _stopped(url):
    """Ask the drives until none is enabled any more; return their states."""
    deadline = time.monotonic() + DEADLINE
    seen = states(url)
    while DriveState.ENABLED in seen and time.monotonic() < deadline:
        seen = states(url)
    return seen


def test_a_person_jogs_one_motor_and_its_sign_is_shown(write_dog):
    body = str(write_dog(("protocol: cia402", "protocol: mit\n  profile: damiao-8006")))
    tries = []
    while len(tries) < TRIES and "sign:" not in "".join(tries):
        with _on_a_bus("--body", body) as url:
            code, output = _jog(body, url)
            tries.append(output)
    assert re.search(r"FR_knee: moved \+(1\.[89]|2\.[01])\d degrees; sign: -1", output), tries
    assert code == 0


def _jog(body, url):
    """Jog a knee as a person does, saying yes to all; return the exit code and what the terminal showed."""
    jog = ["can", "jog", body, "--bus", f"a={url}", "--joint", "FR_knee"]
    person, terminal = pty.openpty()
    line = [sys.executable, "-m", "fleet", *jog]
    with subprocess.Popen(line, stdin=terminal, stdout=terminal, stderr=terminal) as jogging:
        os.close(terminal)
        output = ""
        for words in ("all people keep clear?", "Did it move the foot to the rear?", "sign: -1"):
            output += _read_until(person, words)
            os.write(person, b"y\n")
    os.close(person)
    return jogging.returncode, output


def _read_until(terminal, words):
    """Return what a terminal shows until some words come, or its program ends."""
    shown, deadline = "", time.monotonic() + DEADLINE
    while words not in shown and time.monotonic() < deadline:
        if select.select([terminal], [], [], 0.5)[0]:
            with contextlib.suppress(OSError):  # the program has ended
                shown += os.read(terminal, 4096).decode()
                continue
            break
    return shown
