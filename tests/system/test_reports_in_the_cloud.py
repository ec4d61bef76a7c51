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
from typing import Literal

from fleet.adapter import Adapter
from fleet.adapter import AdapterConfig
from fleet.commands import command
from fleet.errors import Refused
from fleet.model.health import Health, Level


class ClimberConfig(AdapterConfig):
    adapter: Literal["climber"]


class Climber(Adapter[ClimberConfig]):
    Config = ClimberConfig
    failsafe = "it moves nothing"

    async def connect(self):
        self.robot.log.info("the climber is there")

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
        """Do not answer any more."""
        self.robot.health(Health(Level.OFFLINE, "nothing received for 3 s"))

'''


@pytest.fixture(params=["main", "arm"])
def rex(request, fleet, subscriber, mosquitto, tmp_path):
    """Run a robot in the edge's process, or in a worker; returns its pilot."""
    twin = str(uuid.uuid4())
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "climber.py").write_text(CLIMBER)
    config = {
        "edge": {"id": f"yard-{uuid.uuid4().hex[:6]}"},
        "plugins": [str(tmp_path / "plugins")],
        "cloud": {"host": "127.0.0.1", "port": mosquitto.port, "tls": False},
        "robots": [{"name": "rex", "twin": twin, "adapter": "climber", "worker": request.param}],
    }
    file = tmp_path / "fleet.yaml"
    file.write_text(json.dumps(config))
    pilot = subscriber("127.0.0.1", mosquitto.port, "#").pilot(twin)
    running = fleet("run", "--json", str(file))
    running.robot("rex", "is well", lambda state: state["health"] == "ok")
    pilot.wait_for("telemetry", "connected", lambda message: message["type"] == "connected")
    pilot.worker, pilot.edge = request.param, running
    return pilot


def test_what_befalls_a_robot_is_reported_in_the_cloud_to_its_end(rex):
    rex.publish("command", command="climb", data={})
    wait_until("the end of what was taken", lambda: len(rex.answers("climb")) == 2)
    taken, end = rex.answers("climb")
    assert (taken["status"], taken.get("done")) == ("ok", None)
    assert (end["status"], end["done"]) == ("error", False)
    assert end["reason"] == "it did not climb: Motors not armed"

    said = rex.wait_for("driverlog", "the host's warning", lambda line: "climb failed" in line["message"])
    assert said["level"] == "WARNING"

    rex.publish("command", command="emergency_stop", data={}, session_id="anna")
    event = rex.wait_for("event", "the stop", lambda event: event["event_type"] == "emergency_stop")
    assert (event["source"], event["data"]["severity"]) == ("fleet", "critical")
    if rex.worker == "main":  # a worker hears of it first on the bus's stop key, which names nobody
        assert event["data"]["asker"] == {"way": "cloud", "name": "anna", "source_type": "tele"}

    assert rex.command("unplug")["status"] == "ok"
    lost = rex.wait_for("event", "lost", lambda event: event["event_type"] == "lost")
    assert lost["data"]["cause"] == "nothing received for 3 s"
    rex.wait_for(
        "edge_health",
        "offline, with its cause",  # a robot in a worker was offline before, too, while that started
        lambda beat: (beat["health"], beat["cause"]) == ("offline", "nothing received for 3 s"),
    )

    def own():
        return [payload for topic, payload in list(rex.subscriber.received) if topic.startswith("edges/")]

    wait_until(
        "the edge's own roll-up names it",
        lambda: any(payload["unwell"] and payload["unwell"][0]["name"] == "rex" for payload in own()),
    )
    assert own()[0]["type"] == "edge_state"


def test_a_command_that_the_death_of_the_edge_cut_off_has_its_end_in_the_cloud(rex):
    assert rex.command("climb")["status"] == "ok"
    wait_until("the end of what is told already", lambda: len(rex.answers("climb")) == 2)
    wait_until("that is on disk", lambda: "climb failed" in rex.edge.call("history", "rex").stdout)
    assert rex.command("wander")["status"] == "ok"
    (edge,) = psutil.Process(rex.edge.process.pid).children()
    os.kill(edge.pid, signal.SIGKILL)
    rex.wait_for("command", "the end of wander", lambda said: said["command"] == "wander" and "done" in said)
    end = rex.answers("wander")[-1]
    assert (end["status"], end["done"]) == ("error", False)
    assert end["reason"] == "the edge was restarted meanwhile; how it ended is unknown"
    rex.retry_until_accepted("unplug")
    assert len(rex.answers("climb")) == 2, "its end was told before"
    assert len(rex.answers("wander")) == 2
    history = rex.edge.call("history", "rex", "--json").stdout
    assert "wander failed: the edge was restarted meanwhile" in history
