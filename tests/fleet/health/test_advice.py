"""The next thing to do about a cause, from words in it, here and in the console: held to the real texts."""

import asyncio
import re
from pathlib import Path
from unittest.mock import Mock

import pytest

import fleet
from fleet.adapter import AdapterConfig, FrameAdapter
from fleet.config.schema import StopInputConfig
from fleet.errors import LinkLost
from fleet.health.advice import advice_for
from fleet.host.edge.certificate_expiry import CertificateExpiry
from fleet.host.process.stop_inputs import StopInput
from fleet.host.robot.adapter_factory import create_adapter
from fleet.host.robot.adapter_runner import quarantined
from fleet.host.robot.attached_adapter import AttachedAdapter
from fleet.host.robot.battery_watch import BatteryWatch
from fleet.host.robot.separation_keeper import HoldNotice
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.host.safety.fence import Fence
from fleet.host.safety.separation import Occupant
from fleet.link.memory import MemoryRobot
from fleet.link.url import open_link
from fleet.model.geometry import Vector3
from fleet.model.summary import Trouble
from fleet.robot_config import BatteryPolicy
from fleet.testing.clock import ManualClock
from fleet.testing.robot import RecordingRobot, serve


@pytest.mark.parametrize(
    ("cause", "link", "advice"),
    [
        ("No such file or directory; is it plugged in?", "serial:/dev/ttyUSB3", "check the cable, the hub"),
        ("no permission; add this user to the device's group", "serial:/dev/ttyACM0", "fleet doctor on barn"),
        ("quarantined after 3 failures in 60 s", "", "fleet send rex restart_adapter"),
        ("ended with exit code 1", "worker arms", "fleet logs shows why worker arms ended"),
        ("no heartbeat for 3 s", "udpin:0.0.0.0:14550", "power and link of the robot: udpin:0.0.0.0:14550"),
        ("something nobody knows {braces}", "", "fleet describe rex; fleet history rex"),
    ],
)
def test_a_cause_of_robots_has_a_next_thing_to_do(cause, link, advice):
    assert advice in advice_for(Trouble("fault", cause, 1.0, 1, "ugv", link, ("rex",)), "barn")


@pytest.mark.parametrize(
    ("cause", "reach", "advice"),
    [
        ("not on the bus", "gone", "power, network"),
        ("on the bus, but it sends no summary", "silent", "its event loop hangs"),
        ("the disk is full", "up", "fleet doctor looks at its disk"),
        ("something nobody knows", "up", "on barn: fleet doctor, fleet logs"),
    ],
)
def test_a_problem_of_the_edge_has_one_too(cause, reach, advice):
    assert advice in advice_for(Trouble("degraded", cause, 1.0), "barn", reach=reach)


# -- the real texts -----------------------------------------------------------------------------------


class Quiet(FrameAdapter[AdapterConfig]):
    """A robot that says nothing."""

    class Config(AdapterConfig):
        link: str = "memory:quiet"

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        yield b"s"


async def silent():
    """Return the causes of a silent robot: before it was heard, and when its link counts as lost."""
    robot = RecordingRobot()
    config = Quiet.Config(name="rex", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f")
    with MemoryRobot("quiet"):
        serving = asyncio.create_task(serve(create_adapter(Quiet, config, robot)))
        await robot.until(lambda: robot.healths)
        with pytest.raises(LinkLost) as lost:
            robot.advance(10.0)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
    return robot.healths[0].cause, str(lost.value)


def stop_input():
    config = StopInputConfig(name="gate", kind="serial", device="/dev/gate")
    return StopInput(config, stop=print, hold=lambda: None, renew=print, clock=ManualClock()).trouble


async def unplugged():
    with pytest.raises(LinkLost) as lost:
        await open_link("serial:/dev/no-such-device?baud=9600", print)
    return str(lost.value)


def low_battery():
    watch = BatteryWatch(
        BatteryPolicy(action="land"), event_reporter=Mock(), request=Mock(), free=lambda: True
    )
    watch.observe(5.0)
    return watch.forced


def held():
    here, there = (Occupant(name, 1.0, 0.5, Vector3()) for name in ("rex", "beast"))
    return HoldNotice(ManualClock(), Mock()).say("held", here, there)


def certificate(folder):
    (folder / "edge.pem").write_text("nonsense")
    return CertificateExpiry([folder / "edge.pem"], ManualClock()).problem


async def real_texts(folder):
    """Return texts as their modules write them, by what happened."""
    latch = EmergencyStopLatch()
    latch.engage("asked by anna")
    unspoken, quiet = await silent()
    return {
        "emergency stop": latch.refusal(),
        "stop input": stop_input(),
        "quarantine": quarantined("rex", "RuntimeError: boom"),
        "unplugged": await unplugged(),
        "unspoken": unspoken,
        "quiet": quiet,
        "unreached": AttachedAdapter("rex").unreachable_refusal,
        "battery": low_battery(),
        "fence": Fence((YARD,)).trouble(Vector3(9, 9), Vector3()),
        "held": held(),
        "certificate": certificate(folder),
    }


YARD = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
ADVICE = {
    "emergency stop": "fleet release",
    "stop input": "fleet release",
    "quarantine": "fleet send rex restart_adapter",
    "unplugged": "check the cable",
    "unspoken": "check power and link of the robot",
    "quiet": "check power and link of the robot",
    "unreached": "check power and link of the robot",
    "battery": "charge it",
    "fence": "back inside its fence",
    "held": "move the robots apart",
    "certificate": "fleet certs renew",
}
IN_THE_CONSOLE = {
    "emergency stop": "release it on its page",
    "stop input": "release it on its page",
    "quarantine": "restart_adapter ends the quarantine",
    "unplugged": "Look at cable",
    "unspoken": "Is it switched on",
    "quiet": "Is it switched on",
    "unreached": "Is it switched on",
    "battery": "Charge it",
    "fence": "its fence",
    "held": "Move the other robot away",
    "certificate": "fleet certs renew",
}


async def test_the_advice_knows_the_texts_as_they_are_written(tmp_path):
    texts = await real_texts(tmp_path)
    found = {
        what: advice_for(Trouble("fault", text, 1.0, 1, "ugv", "", ("rex",)), "barn")
        for what, text in texts.items()
    }
    assert {what: text for what, text in texts.items() if ADVICE[what] not in found[what]} == {}


async def test_the_console_knows_the_texts_as_they_are_written(tmp_path):
    source = Path(fleet.__file__).with_name("console") / "static" / "overview.js"
    rows = re.findall(r'^  \[/(.+)/i, "(.+)"\],$', source.read_text(), re.MULTILINE)
    assert len(rows) >= 10
    found = {
        what: next((advice for words, advice in rows if re.search(words, text, re.IGNORECASE)), "")
        for what, text in (await real_texts(tmp_path)).items()
    }
    assert {what: advice for what, advice in found.items() if IN_THE_CONSOLE[what] not in advice} == {}
