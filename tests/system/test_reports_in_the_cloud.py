"""What the cloud is told of a robot, heard on a real broker: ends of commands, events, log lines, health."""

import json
import os
import signal
import uuid

import psutil
import pytest

from tests.tools.waiting import wait_until

CLIMBER = '''
import asyncio
from pathlib import Path
from typing import Literal

from fleet.adapter import Adapter
from fleet.adapter import AdapterConfig
from fleet.commands import command
from fleet.errors import Refused
from fleet.model.health import Health, Level


class ClimberConfig(AdapterConfig):
    adapter: Literal["climber"]
    unplugged: str


class Climber(Adapter[ClimberConfig]):
    Config = ClimberConfig
    failsafe = "it moves nothing"

    async def connect(self):
        self.robot.log.info("the climber is there")
        self.robot.every(0.1, self._answer)

    async def stop(self, reason):
        pass

    def halt(self):
        pass

    @command("climb")
    async def climb(self):
        """Be taken, and fail a second later."""
        yield None
        await asyncio.sleep(1.0)
        raise Refused("it did not climb: Motors not armed")

    @command("wander", timeout=300)
    async def wander(self):
        """Be taken, and not end."""
        yield None
        await asyncio.sleep(300)

    @command("unplug", moves=False, safe=True)
    async def unplug(self):
        """Do not answer any more, until the file is gone."""
        Path(self.config.unplugged).touch()
        self._answer()

    def _answer(self):
        offline = Health(Level.OFFLINE, "nothing received for 3 s")
        self.robot.health(offline if Path(self.config.unplugged).exists() else Health())

'''


WORKERS = {"rex": "main", "max": "arm"}
"""Where a robot runs: in the edge's process, or in a worker."""
TWINS = {name: str(uuid.uuid4()) for name in WORKERS}


@pytest.fixture(scope="module")
def yard(shared_fleet, shared_foreign_broker, shared_folder):
    """Run both robots for all tests."""
    (shared_folder / "plugins").mkdir()
    (shared_folder / "plugins" / "climber.py").write_text(CLIMBER)
    config = {
        "edge": {"id": f"yard-{uuid.uuid4().hex[:6]}"},
        "plugins": ["plugins"],
        "cloud": {"host": "127.0.0.1", "port": shared_foreign_broker.port, "tls": False},
        "robots": [
            {
                "name": name,
                "twin": TWINS[name],
                "adapter": "climber",
                "worker": worker,
                "unplugged": str(shared_folder / name),
            }
            for name, worker in WORKERS.items()
        ],
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(config))
    return shared_fleet("run", "--json", folder=shared_folder)


@pytest.fixture(params=WORKERS)
def pilot(request, yard, shared_foreign_broker, shared_folder, subscriber):
    """Put the robots right, whatever the test before has done to them; returns the pilot of one."""
    name = request.param
    for each in WORKERS:
        (shared_folder / each).unlink(missing_ok=True)
        yard.robot(each, "is well", lambda state: state["health"] == "ok")
        assert yard.call("send", each, "release_emergency_stop").returncode == 0
    pilot = subscriber("127.0.0.1", shared_foreign_broker.port, "#").pilot(TWINS[name])
    wait_until("it is told that all are well", lambda: own(pilot) and not own(pilot)[-1]["unwell"])
    pilot.name, pilot.edge, pilot.told = name, yard, len(own(pilot))
    return pilot


def own(pilot):
    """Return what the edge says of itself."""
    heard = list(pilot.subscriber.received)
    return [payload for topic, payload in heard if topic.startswith("edges/")]


def test_what_befalls_a_robot_is_reported_in_the_cloud_to_its_end(pilot):
    pilot.publish("command", command="climb", data={})
    wait_until("the end of what was taken", lambda: len(pilot.answers("climb")) == 2)
    taken, end = pilot.answers("climb")
    assert (taken["status"], taken.get("done")) == ("ok", None)
    assert (end["status"], end["done"]) == ("error", False)
    assert end["reason"] == "it did not climb: Motors not armed"

    said = pilot.wait_for("driverlog", "the host's warning", lambda line: "climb failed" in line["message"])
    assert said["level"] == "WARNING"

    pilot.publish("command", command="emergency_stop", data={}, session_id="anna")
    event = pilot.wait_for("event", "the stop", lambda event: event["event_type"] == "emergency_stop")
    assert (event["source"], event["data"]["severity"]) == ("fleet", "critical")
    if WORKERS[pilot.name] == "main":  # a worker hears of it first on the bus's stop key, which names nobody
        assert event["data"]["asker"] == {"way": "cloud", "name": "anna", "source_type": "tele"}

    assert pilot.command("unplug")["status"] == "ok"
    lost = pilot.wait_for("event", "lost", lambda event: event["event_type"] == "lost")
    assert lost["data"]["cause"] == "nothing received for 3 s"
    pilot.wait_for(
        "edge_health",
        "offline, with its cause",  # a robot in a worker was offline before, too, while that started
        lambda beat: (beat["health"], beat["cause"]) == ("offline", "nothing received for 3 s"),
    )

    wait_until(
        "the edge's own roll-up names it",
        lambda: any(
            payload["unwell"] and payload["unwell"][0]["name"] == pilot.name
            for payload in own(pilot)[pilot.told :]
        ),
    )
    assert own(pilot)[0]["type"] == "edge_state"


def test_a_command_that_the_death_of_the_edge_cut_off_has_its_end_in_the_cloud(pilot):
    failed = failures_on_disk(pilot)
    assert pilot.command("climb")["status"] == "ok"
    wait_until("the end of what is told already", lambda: len(pilot.answers("climb")) == 2)
    wait_until("that is on disk", lambda: failures_on_disk(pilot) > failed)
    assert pilot.command("wander")["status"] == "ok"
    (edge,) = psutil.Process(pilot.edge.process.pid).children()
    os.kill(edge.pid, signal.SIGKILL)
    pilot.wait_for(
        "command", "the end of wander", lambda said: said["command"] == "wander" and "done" in said
    )
    end = pilot.answers("wander")[-1]
    assert (end["status"], end["done"]) == ("error", False)
    assert end["reason"] == "the edge was restarted meanwhile; how it ended is unknown"
    pilot.retry_until_accepted("unplug")
    assert len(pilot.answers("climb")) == 2, "its end was told before"
    assert len(pilot.answers("wander")) == 2
    history = pilot.edge.call("history", pilot.name, "--json").stdout
    assert "wander failed: the edge was restarted meanwhile" in history


def failures_on_disk(pilot):
    """Return how many climbs have failed, by the history."""
    return pilot.edge.call("history", pilot.name).stdout.count("climb failed")
