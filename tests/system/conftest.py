"""A fleet as a user starts it: a real process, a real broker, real clients on the other side."""

import asyncio
import contextlib
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self

import paho.mqtt.client as mqtt
import pytest

from fleet.cli.demo import twin_of
from fleet.wire.topics import Topics
from fleet_ugv.sim.port import SimPort
from fleet_ugv.sim.server import Bases
from fleet_ugv.sim.spec import BaseSpec
from tests.tools.command_line import command_line, own_folders
from tests.tools.waiting import DEADLINE, wait_until

HERE = Path(__file__).parent
REAL_TIME = (
    *("test_console.py", "test_dog.py", "test_joints.py", "test_sdk.py"),
    *("test_sdk_vehicles.py", "test_ugv.py", "test_wheels.py"),
)
"""Robots whose simulation needs the processor in time: never two of them at once on two cores."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the real-time tests, of which one runs at a time, and keep those that share an edge together."""
    for item in items:
        if item.path.parent != HERE:
            continue
        if item.path.name in REAL_TIME:
            item.add_marker(pytest.mark.real_time)
        elif item.get_closest_marker("real_time"):
            continue  # these are one group
        elif "flying" in item.fixturenames:
            item.add_marker(pytest.mark.xdist_group(f"flying {flavour_of(item)}"))
        elif "shared_fleet" in item.fixturenames:
            item.add_marker(pytest.mark.xdist_group(item.path.stem))


def flavour_of(item: pytest.Item) -> str:
    """Return the flavour of the drones that a test flies; empty for a test that does not say it."""
    return str(item.callspec.params.get("flying", "")) if hasattr(item, "callspec") else ""


STARTS_WITHIN = 150.0  # s for all robots of a demo on a computer that does much else


class Running:
    """A ``fleet`` process: its lines, and how it ends."""

    def __init__(self, *arguments: str, runtime: str, folder: Path | None = None) -> None:
        self.environment = os.environ | own_folders(runtime) | {"PYTHONUNBUFFERED": "1"}
        self.states: dict[str, dict[str, Any]] = {}
        self.errors: list[str] = []
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fleet", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=self.environment,
            cwd=folder,
        )
        self._readers = [
            threading.Thread(target=self._read_states, daemon=True),
            threading.Thread(target=self._read_errors, daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def _read_states(self) -> None:
        for line in self.process.stdout:
            state = json.loads(line)
            if "name" in state:
                self.states[state["name"]] = state
            else:
                self.errors.append(line.rstrip())  # why it ended

    def _read_errors(self) -> None:
        for line in self.process.stderr:
            self.errors.append(line.rstrip())

    def robot(self, name: str, what: str, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Wait until a robot's state is so."""

        def state() -> dict[str, Any] | None:
            assert self.process.poll() is None, "\n".join(self.errors)
            found = self.states.get(name)
            return found if found and holds(found) else None

        try:
            return wait_until(f"{name} {what}", state, within=STARTS_WITHIN)
        except AssertionError as error:
            raise AssertionError(
                f"{error}; last {self.states.get(name)}; " + "\n".join(self.errors[-20:])
            ) from None

    def line(self, pattern: str) -> re.Match[str]:
        """Wait for a line on stderr."""
        return wait_until(
            f"a line like {pattern!r}",
            lambda: next((found for line in list(self.errors) if (found := re.search(pattern, line))), None),
        )

    def call(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run another ``fleet`` command against it."""
        return command_line(self.environment["FLEET_RUNTIME_DIR"], *arguments)

    def end(self) -> int:
        """Press Ctrl-C; return the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(DEADLINE)
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
            raise AssertionError("it did not end after Ctrl-C: " + "\n".join(self.errors[-20:]))
        for reader in self._readers:
            reader.join()
        self.process.stdout.close()
        self.process.stderr.close()
        return self.process.returncode


class Subscriber:
    """A plain MQTT client that hears everything below a topic and can speak."""

    def __init__(self, host: str, port: int, topic: str) -> None:
        self.messages: queue.Queue[tuple[str, dict[str, Any]]] = queue.Queue()
        self.received: list[tuple[str, dict[str, Any]]] = []
        self.on_topic: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
        self.address = (host, port)
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, protocol=mqtt.MQTTv5)
        ready = threading.Event()
        self.client.on_message = self._take
        self.client.on_subscribe = lambda *_: ready.set()
        self.client.connect(host, port)
        self.client.loop_start()
        self.client.subscribe(topic, qos=1)
        assert ready.wait(DEADLINE)

    def _take(self, _client: Any, _data: Any, message: mqtt.MQTTMessage) -> None:
        payload = json.loads(message.payload)
        self.on_topic[message.topic].append(payload)
        self.received.append((message.topic, payload))

    def publish(self, topic: str, payload: dict[str, Any]) -> None:
        """Publish, QoS 1."""
        self.client.publish(topic, json.dumps(payload), qos=1)

    def of(self, leaf: str) -> list[dict[str, Any]]:
        """Return the payloads heard on topics that end so."""
        heard = list(self.on_topic.items())
        return [payload for topic, payloads in heard if topic.endswith("/" + leaf) for payload in payloads]

    def pilot(self, twin: str) -> "Pilot":
        """Make a pilot for a twin that is heard."""
        return Pilot(self, twin)

    def close(self) -> None:
        self.client.disconnect()
        with contextlib.suppress(AttributeError):  # paho forgets its thread when that ends, which may be now
            self.client.loop_stop()
        self.client._reset_sockets()  # paho leaves them to the garbage collector


class Pilot:
    """One twin, flown with plain MQTT messages."""

    def __init__(self, subscriber: Subscriber, twin: str) -> None:
        self.subscriber = subscriber
        self.twin = twin

    def topic(self, leaf: str) -> str:
        return Topics("").twin(self.twin, leaf)

    def of(self, leaf: str) -> list[dict[str, Any]]:
        """Return what was heard on one of the twin's topics."""
        return list(self.subscriber.on_topic[self.topic(leaf)])

    def publish(self, leaf: str, **message: Any) -> None:
        """Publish as a person at a remote control would."""
        self.subscriber.publish(
            self.topic(leaf), {"source_type": "tele", "timestamp": time.time(), **message}
        )

    def wait_for(self, leaf: str, what: str, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Wait for a message, from the first one on."""

        def look() -> dict[str, Any] | None:
            return next((each for each in self.of(leaf) if holds(each)), None)

        try:
            return wait_until(f"{leaf}: {what}", look, within=90)
        except AssertionError as error:
            raise AssertionError(
                f"{error}; last heard {self.of(leaf)[-2:]}, {self.of('driverlog')[-5:]}"
            ) from None

    def answers(self, name: str) -> list[dict[str, Any]]:
        """Return the legacy answers to a command on the command topic."""
        return [each for each in self.of("command") if "status" in each and each["command"] == name]

    def _receipts(self, name: str) -> list[dict[str, Any]]:
        """Return the answers to a command but for the failed ends of what was taken before."""
        return [each for each in self.answers(name) if each.get("done") is not False]

    def command(self, name: str, **data: Any) -> dict[str, Any]:
        """Send a command and return its answer."""
        before = len(self._receipts(name))
        self.publish("command", command=name, data=data)
        return wait_until(f"an answer to {name}", lambda: self._receipts(name)[before:])[-1]

    def retry_until_accepted(self, name: str, **data: Any) -> None:
        """Send a command until it is taken, as a person does with a drone that is not ready yet."""
        wait_until(f"{name} to be taken", lambda: self.command(name, **data)["status"] == "ok", within=90)

    def position(self) -> dict[str, float]:
        return self.of("position")[-1]["position"]

    def reaches(self, what: str, holds: Callable[[dict[str, float]], bool]) -> None:
        """Wait until the position is so."""
        try:
            wait_until(what, lambda: bool(self.of("position")) and holds(self.position()), within=90)
        except AssertionError as error:
            raise AssertionError(f"{error}; at {self.position()}, {self.of('driverlog')[-5:]}") from None

    def hold(self, verb: str, *, until: Callable[[], Any], **data: Any) -> None:
        """Hold a verb, many times a second, until something is seen."""

        def again() -> Any:
            self.publish("command", command=verb, data=data)
            return until()

        wait_until(f"{verb} to be seen", again)

    def drive(self, verb: str, *, until: Callable[[], Any], **data: Any) -> None:
        """Hold a verb until something is seen, then stop."""
        self.hold(verb, until=until, **data)
        self.publish("command", command="stop", data={})


class BasesThread:
    """Simulated bases on real device files, on a thread: a test sees what they truly do."""

    def __init__(self, folder: Path) -> None:
        self._loop = asyncio.new_event_loop()
        self._bases = Bases(folder)
        self._life: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._live, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._life.cancel)
        self._thread.join()
        self._loop.close()

    def _live(self) -> None:
        self._life = self._loop.create_task(self._bases.run())
        with contextlib.suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._life)

    def add(self, profile: str) -> SimPort:
        """Add a base; returns its device and all that is behind it."""
        adding = self._bases.add(BaseSpec(profile))
        return asyncio.run_coroutine_threadsafe(adding, self._loop).result(DEADLINE)

    def call(self, what: Callable[[], None]) -> None:
        """Do something to a base on the thread where it lives."""
        self._loop.call_soon_threadsafe(what)


@pytest.fixture
def bases(tmp_path: Path) -> Iterator[BasesThread]:
    """Make simulated bases that know nothing of the fleet, until the test ends."""
    with BasesThread(tmp_path) as bases:
        yield bases


@pytest.fixture(scope="module")
def shared_bases(shared_folder: Path) -> Iterator[BasesThread]:
    """Make simulated bases for all tests of a module."""
    with BasesThread(shared_folder) as bases:
        yield bases


@contextlib.contextmanager
def runtime_folder() -> Iterator[str]:
    """Make a short directory for the sockets of the bus."""
    path = tempfile.mkdtemp(prefix="fl")
    yield path
    shutil.rmtree(path, ignore_errors=True)


@contextlib.contextmanager
def fleets(runtime: str) -> Iterator[Callable[..., Running]]:
    """Start ``fleet ARGUMENTS``; it is ended, and must end well, with the block."""
    started: list[tuple[Running, int]] = []

    def start(*arguments: str, folder: Path | None = None, code: int = 0) -> Running:
        started.append((Running(*arguments, runtime=runtime, folder=folder), code))
        return started[-1][0]

    yield start
    ends = [(each.end(), code, each.errors[-20:]) for each, code in started]
    assert all(end == code for end, code, _ in ends), ends


@contextlib.contextmanager
def subscribers() -> Iterator[Callable[..., Subscriber]]:
    """Make MQTT clients that are closed with the block."""
    made: list[Subscriber] = []

    def make(host: str, port: int, topic: str) -> Subscriber:
        made.append(Subscriber(host, port, topic))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def runtime() -> Iterator[str]:
    """Make a short directory for the sockets of the bus."""
    with runtime_folder() as path:
        yield path


@pytest.fixture
def fleet(runtime: str) -> Iterator[Callable[..., Running]]:
    """Start ``fleet ARGUMENTS``; it is ended, and must end well, after the test."""
    with fleets(runtime) as start:
        yield start


@pytest.fixture
def subscriber() -> Iterator[Callable[..., Subscriber]]:
    """Make MQTT clients that are closed after the test."""
    with subscribers() as make:
        yield make


@pytest.fixture(scope="module")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a folder for all tests of a module."""
    return tmp_path_factory.mktemp("shared")


@pytest.fixture(scope="module")
def shared_runtime() -> Iterator[str]:
    """Make the directory of ``shared_fleet``."""
    with runtime_folder() as path:
        yield path


@pytest.fixture(scope="module")
def shared_fleet(shared_runtime: str) -> Iterator[Callable[..., Running]]:
    """Start ``fleet ARGUMENTS`` for all tests of a module."""
    with fleets(shared_runtime) as start:
        yield start


DRONES_ALONE = ("--ugvs", "0", "--dogs", "0")
PX4, ARDUPILOT = "px4 on the demo's broker", "ardupilot on a foreign broker"
"""Autopilot and broker know nothing of each other, so two pairs show all that four would."""
NUMBERS = {PX4: 1, ARDUPILOT: 2}
"""The demo's first drone of a flavour."""


@pytest.fixture(params=[PX4, ARDUPILOT], scope="module")
def flying(request: Any) -> Iterator[tuple[str, int]]:
    """Run a demo with a drone of this flavour, on its own broker or on a foreign one; gives the broker."""
    broker: tuple[str, ...] = ()
    if request.param == ARDUPILOT:
        broker = ("--broker", f"127.0.0.1:{request.getfixturevalue('shared_foreign_broker').port}")
    with runtime_folder() as runtime, fleets(runtime) as fleet:
        drones = NUMBERS[request.param]  # as many as it takes to have one of its flavour
        running = fleet("demo", "--drones", str(drones), *DRONES_ALONE, "--json", *broker)
        host, port = running.line(r"MQTT broker +(\S+):(\d+)").groups()
        for number in range(drones):
            running.robot(f"drone-{number + 1}", "is well", lambda state: state["health"] == "ok")
        yield host, int(port)


@pytest.fixture
def pilot(request: Any, flying: tuple[str, int], subscriber: Any) -> Pilot:
    """Make a pilot for the drone of the pair's flavour, which is where the test before has left it."""
    twin = twin_of(f"drone-{NUMBERS[request.node.callspec.params['flying']]}")
    pilot: Pilot = subscriber(*flying, f"cyberwave/twin/{twin}/#").pilot(twin)
    pilot.wait_for("position", "the drone is there", bool)
    return pilot
