"""What the cloud is told of a robot, heard on a real broker: ends of commands, events, log lines, health."""

import json
import uuid

import pytest

from fleet.testing.waiting import wait_until

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

    @command("unplug", moves=False, safe=True)
    async def unplug(self):
        """Do not answer any more."""
        self.robot.health(Health(Level.OFFLINE, "nothing heard for 3 s"))

'''


@pytest.fixture(params=["main", "arm"])
def rex(request, fleet, ears, mosquitto, tmp_path):
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
    pilot = ears("127.0.0.1", mosquitto.port, "#").pilot(twin)
    running = fleet("run", "--json", str(file))
    running.robot("rex", "is well", lambda state: state["health"] == "ok")
    pilot.heard("telemetry", "connected", lambda message: message["type"] == "connected")
    pilot.worker = request.param
    return pilot


def test_what_befalls_a_robot_is_told_in_the_cloud_to_its_end(rex):
    rex.say("command", command="climb", data={})
    wait_until("the end of what was taken", lambda: len(rex.answers("climb")) == 2)
    taken, end = rex.answers("climb")
    assert (taken["status"], taken.get("done")) == ("ok", None)
    assert (end["status"], end["done"]) == ("error", False)
    assert end["reason"] == "it did not climb: Motors not armed"

    said = rex.heard("driverlog", "the host's warning", lambda line: "climb failed" in line["message"])
    assert said["level"] == "WARNING"

    rex.say("command", command="emergency_stop", data={}, session_id="anna")
    event = rex.heard("event", "the stop", lambda event: event["event_type"] == "emergency_stop")
    assert (event["source"], event["data"]["severity"]) == ("fleet", "critical")
    if rex.worker == "main":  # a worker hears of it first on the bus's stop key, which names nobody
        assert event["data"]["asker"] == {"way": "cloud", "name": "anna", "source_type": "tele"}

    assert rex.command("unplug")["status"] == "ok"
    lost = rex.heard("event", "lost", lambda event: event["event_type"] == "lost")
    assert lost["data"]["cause"] == "nothing heard for 3 s"
    rex.heard("edge_health", "offline", lambda beat: beat["health"] == "offline")
    beat = next(each for each in rex.of("edge_health") if each["health"] == "offline")
    assert beat["cause"] == "nothing heard for 3 s"

    whose = next(topic for topic, _ in rex.ears.heard if topic.startswith("edges/"))
    own = [payload for topic, payload in rex.ears.heard if topic == whose]
    wait_until(
        "the edge's own roll-up names it",
        lambda: any(
            payload["unwell"] and payload["unwell"][0]["name"] == "rex"
            for topic, payload in list(rex.ears.heard)
            if topic == whose
        ),
    )
    assert own[0]["type"] == "edge_state"
