"""Wheeled robots of a real fleet, over real device files: what the base truly does."""

import json
import math
import subprocess
import sys
import uuid

import psutil
import pytest

from fleet.config.load import load
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8c"


@pytest.fixture
def roll(fleet, broker, tmp_path):
    """Run a fleet of one base on a link; gives the process when the base is well."""

    def roll(port, profile, **fields):
        robot = {"name": "rover", "twin": TWIN, "adapter": "ugv", "profile": profile, "link": port.url}
        cloud = {"host": "127.0.0.1", "port": broker.port, "tls": False}
        file = {"edge": {"id": f"yard-{uuid.uuid4().hex[:6]}"}, "cloud": cloud, "robots": [robot | fields]}
        (tmp_path / "fleet.yaml").write_text(json.dumps(file))
        running = fleet("run", "--json", folder=tmp_path)
        running.robot("rover", "is well", is_well)
        return running

    return roll


def is_well(state):
    return state["health"] == "ok"


def worker_of(running):
    """Return the one worker process of an edge."""
    [worker] = [
        child
        for child in psutil.Process(running.process.pid).children(recursive=True)
        if "fleet.host.workers.worker_process" in child.cmdline()
    ]
    return worker


def test_a_base_goes_its_way_and_stops_by_itself_whatever_dies(roll, bases, broker, subscriber):
    port = bases.add("waveshare-beast")
    running = roll(port, "waveshare-beast", worker="wheels")
    pilot = subscriber("127.0.0.1", broker.port, f"cyberwave/twin/{TWIN}/#").pilot(TWIN)
    pilot.publish("command", command="move_forward", data={"distance": 0.3})
    pilot.wait_for("navigate/status", "the end of the way", lambda status: status["status"] == "completed")
    assert port.board.physics.x == pytest.approx(0.3, abs=0.1)
    supervisor = psutil.Process(running.process.pid)
    for helped in (True, False):
        pilot.hold("move_forward", until=lambda: port.board.physics.speeds[0] > 0.2)
        if not helped:  # nobody halts it for its worker: its firmware must
            supervisor.suspend()
        worker = worker_of(running)
        worker.kill()
        killed = port.now()
        wait_until("the stop", lambda: port.board.physics.wanted == [0.0, 0.0])
        assert port.now() - killed <= port.board.timeout + 0.3  # s that a busy machine may add
        assert (port.board.halted_at is None) is helped
        supervisor.resume()
        worker.wait(60)
        running.robot("rover", "is missed", lambda state: not is_well(state))
        running.robot("rover", "is back", is_well)
        assert port.board.physics.wanted == [0.0, 0.0]
        wait_until("the base to stand", lambda: port.board.physics.speeds == [0.0, 0.0])
    pilot.hold("move_forward", until=lambda: port.board.physics.speeds[0] > 0.2)
    bases.call(port.unplug)
    running.robot("rover", "is missed", lambda state: "is it plugged in?" in state.get("cause", ""))
    wait_until("the base to stand", lambda: port.board.physics.speeds == [0.0, 0.0])
    bases.call(port.plug)
    running.robot("rover", "is back", is_well)
    assert port.board.physics.wanted == [0.0, 0.0]


class Person:
    """Somebody who runs ``fleet calibrate`` at a terminal and answers what it asks."""

    def __init__(self, running, folder):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fleet", "calibrate", "rover"],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=running.environment,
            cwd=folder,
        )

    def answers(self, question, answer):
        """Read up to a question, and answer it: with a text, or what a call then finds."""
        said = ""
        while not said.endswith(": "):
            letter = self.process.stderr.read(1)
            assert letter, said
            said += letter
        assert question in said
        self.process.stdin.write(f"{answer if isinstance(answer, str) else answer()}\n")
        self.process.stdin.flush()

    def ends(self):
        """Return the exit code."""
        self.process.communicate(timeout=60)
        return self.process.returncode


def test_calibrating_drives_asks_and_writes_what_is_true_of_the_base(roll, bases, tmp_path):
    port = bases.add("ros-arduino")
    wrong = {"track": 0.4, "left": 1.2, "right": 1.2}
    running = roll(port, "ros-arduino", calibration=wrong)
    truth = port.board.physics
    marked = []
    person = Person(running, tmp_path)
    person.answers("Is the way free", "y")
    person.answers("How far did it go", lambda: math.hypot(truth.x, truth.y))
    person.answers("to be marked", "y")
    person.answers("Mark its heading", lambda: marked.append(truth.yaw) or "y")
    person.answers("off its mark", lambda: math.degrees(math.remainder(truth.yaw - marked[0], math.tau)))
    assert person.ends() == 0
    config = json.loads((tmp_path / "fleet.yaml").read_text())
    del config["robots"][0]["calibration"]
    lines = json.dumps(config["robots"][0])[1:-1]
    (tmp_path / "fleet.yaml").write_text(
        f"edge: {{id: yard}}\nrobots: [{{{lines}, calibration: !include rover.calibration.yaml}}]\n"
    )
    [(rover, _)] = load(tmp_path / "fleet.yaml").robots
    assert rover.calibration.left == pytest.approx(1.0, abs=0.03)
    assert rover.calibration.right == pytest.approx(1.0, abs=0.03)
    assert rover.calibration.track == pytest.approx(0.3, abs=0.01)
