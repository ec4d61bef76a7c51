"""An edge that is killed: what the cloud hears of its twins, on a real broker."""

import json
import os
import signal
import uuid

import psutil
import pytest

from tests.system.conftest import subscribers
from tests.tools.command_client import PUPPETS
from tests.tools.waiting import wait_until

TWINS = {name: str(uuid.uuid4()) for name in ("rex", "max", "ada")}
PASSWORD = "not-in-any-argv"


@pytest.fixture(scope="module")
def edge(shared_fleet, shared_foreign_broker, tmp_path_factory):
    """Run three puppets on a real broker; gives the process, and who listens."""
    robots = [
        {"name": name, "twin": twin, "adapter": "puppet", "worker": "main", "rate": 0}
        for name, twin in TWINS.items()
    ]
    config = {
        "edge": {"id": f"yard-{uuid.uuid4().hex[:6]}"},
        "plugins": [str(PUPPETS)],
        "cloud": {
            "host": "127.0.0.1",
            "port": shared_foreign_broker.port,
            "tls": False,
            "username": "edge",
            "password": PASSWORD,
        },
        "robots": robots,
    }
    file = tmp_path_factory.mktemp("yard") / "fleet.yaml"
    file.write_text(json.dumps(config))
    with subscribers() as subscriber:
        listener = subscriber("127.0.0.1", shared_foreign_broker.port, "#")
        running = shared_fleet("run", "--json", str(file))
        wait_until(
            "every robot is connected", lambda: all("connected" in telemetry(listener, t) for t in TWINS)
        )
        yield running, listener


def telemetry(listener, robot):
    """Return how a twin came and went, in order."""
    topic = f"cyberwave/twin/{TWINS[robot]}/telemetry"
    types = [message["type"] for received, message in list(listener.received) if received == topic]
    return [each for each in types if each in {"connected", "disconnected"}]


def reasons(listener, robot):
    topic = f"cyberwave/twin/{TWINS[robot]}/telemetry"
    return [message.get("reason") for received, message in list(listener.received) if received == topic]


def test_every_twin_of_a_killed_edge_is_disconnected_and_connected_once_it_is_back(edge):
    running, listener = edge
    (process,) = psutil.Process(running.process.pid).children()
    before = {name: len(telemetry(listener, name)) for name in TWINS}
    os.kill(process.pid, signal.SIGKILL)
    wait_until(
        "every twin is disconnected",
        lambda: all(
            "disconnected" in telemetry(listener, name)[received:] for name, received in before.items()
        ),
    )
    wait_until(
        "every robot is connected again",
        lambda: all(telemetry(listener, name)[-1] == "connected" for name in TWINS),
    )
    assert "the edge died" in reasons(listener, "ada"), "the will is for the first twin alone"


def test_no_program_of_the_edge_shows_its_password(edge):
    supervisor = psutil.Process(edge[0].process.pid)
    family = [supervisor, *supervisor.children(recursive=True)]
    assert not any(PASSWORD in " ".join(each.cmdline()) for each in family)
