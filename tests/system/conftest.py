"""A fleet as a user starts it: a real process, a real broker, real clients on the other side."""

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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import paho.mqtt.client as mqtt
import pytest

DEADLINE = 60.0  # s; two busy cores are slow, and nothing here waits for it when all is well


def wait_until(what: str, holds: Callable[[], Any], *, within: float = DEADLINE) -> Any:
    """Return the first true value of ``holds``; fails after ``within`` seconds, naming what was awaited."""
    end = time.monotonic() + within
    pause = threading.Event()
    while time.monotonic() < end:
        value = holds()
        if value:
            return value
        pause.wait(0.05)
    raise AssertionError(f"waited {within:g} s for {what}")


class Running:
    """A ``fleet`` process: its lines, and how it ends."""

    def __init__(self, *arguments: str, runtime: str, folder: Path | None = None) -> None:
        self.environment = os.environ | {"FLEET_RUNTIME_DIR": runtime, "PYTHONUNBUFFERED": "1"}
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
            self.states[state["name"]] = state

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
            return wait_until(f"{name} {what}", state)
        except AssertionError as error:
            raise AssertionError(f"{error}; last {self.states.get(name)}; " + "\n".join(self.errors[-20:])) from None

    def line(self, pattern: str) -> re.Match[str]:
        """Wait for a line on stderr."""
        return wait_until(
            f"a line like {pattern!r}",
            lambda: next((found for line in list(self.errors) if (found := re.search(pattern, line))), None),
        )

    def call(self, *arguments: str, within: float = 90.0) -> subprocess.CompletedProcess[str]:
        """Run another ``fleet`` command against it."""
        return subprocess.run(
            [sys.executable, "-m", "fleet", *arguments],
            capture_output=True,
            text=True,
            env=self.environment,
            timeout=within,
            check=False,
        )

    def end(self) -> int:
        """Press Ctrl-C; return the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(30)
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
            raise AssertionError("it did not end within 30 s of Ctrl-C: " + "\n".join(self.errors[-20:]))
        for reader in self._readers:
            reader.join()
        self.process.stdout.close()
        self.process.stderr.close()
        return self.process.returncode


class Ears:
    """A plain MQTT client that hears everything below a topic and can speak."""

    def __init__(self, host: str, port: int, topic: str) -> None:
        self.messages: queue.Queue[tuple[str, dict[str, Any]]] = queue.Queue()
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, protocol=mqtt.MQTTv5)
        ready = threading.Event()
        self.client.on_message = self._take
        self.client.on_subscribe = lambda *_: ready.set()
        self.client.connect(host, port)
        self.client.loop_start()
        self.client.subscribe(topic, qos=1)
        assert ready.wait(DEADLINE)

    def _take(self, _client: Any, _data: Any, message: mqtt.MQTTMessage) -> None:
        self.heard.append((message.topic, json.loads(message.payload)))

    def say(self, topic: str, payload: dict[str, Any]) -> None:
        """Publish, QoS 1."""
        self.client.publish(topic, json.dumps(payload), qos=1)

    def of(self, leaf: str) -> list[dict[str, Any]]:
        """Return the payloads heard on topics that end so."""
        return [payload for topic, payload in list(self.heard) if topic.endswith("/" + leaf)]

    def next_of(self, leaf: str, what: str, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Wait for a message on a leaf."""
        return wait_until(
            f"{leaf}: {what}; last {self.of(leaf)[-1:]}",
            lambda: next((payload for payload in self.of(leaf) if holds(payload)), None),
        )

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


@pytest.fixture
def runtime() -> Iterator[str]:
    """A short directory for the bus's sockets."""
    path = tempfile.mkdtemp(prefix="fl")
    yield path
    shutil.rmtree(path, ignore_errors=True)


@pytest.fixture
def fleet(runtime: str) -> Iterator[Callable[..., Running]]:
    """Start ``fleet ARGUMENTS``; it is ended, and must end well, after the test."""
    started: list[Running] = []

    def start(*arguments: str, folder: Path | None = None) -> Running:
        started.append(Running(*arguments, runtime=runtime, folder=folder))
        return started[-1]

    yield start
    codes = [each.end() for each in started]
    assert codes == [0] * len(codes)


@pytest.fixture
def ears() -> Iterator[Callable[..., Ears]]:
    """Make MQTT clients that are closed after the test."""
    made: list[Ears] = []

    def make(host: str, port: int, topic: str) -> Ears:
        made.append(Ears(host, port, topic))
        return made[-1]

    yield make
    for each in made:
        each.close()
