"""The simulated base of a rehearsal."""

import json
import uuid

import pytest

from fleet import Pose, SimulationStart, Vector3
from fleet_ugv.adapter import UgvAdapter
from fleet_ugv.config import UgvConfig
from fleet_ugv.odometry import POSE

HERE = SimulationStart(Pose(Vector3(3.0, 1.0)), battery=60.0)


def simulated(start=HERE, *, profile="waveshare-beast", link="serial:/dev/ttyUSB0?baud=115200", **fields):
    config = UgvConfig(
        name="beast", twin=uuid.UUID(int=1), adapter="ugv", profile=profile, link=link, **fields
    )
    return UgvAdapter.simulation(config, start)


def volts(simulation, seconds, *, speed):
    """Let a base drive for some seconds; return the volts that it tells at the end."""
    output = b""
    for step in range(int(seconds * 20)):
        drive = json.dumps({"T": 1, "L": speed, "R": speed}).encode() + b"\n"
        output = simulation.receive(drive, step / 20) + simulation.step(step / 20) or output
    return json.loads(output.splitlines()[-1])["v"]


def test_a_real_base_and_a_simulated_one_are_simulated_by_their_profile_behind_a_link_in_memory():
    real, already = simulated(), simulated(link="sim:waveshare-beast?seed=5")
    for each in (real, already):
        assert each.what == "simulated waveshare-beast, whose battery does not drain"
        assert (each.config.link, each.config.simulated) == ("memory:beast", False)
        assert each.state == {POSE: Pose(Vector3(3.0, 1.0))}


def test_a_profile_without_a_board_has_no_simulation(monkeypatch):
    monkeypatch.setattr("fleet_ugv.sim.rehearsed.BOARDS", {})
    assert simulated() is None


def test_its_battery_is_as_full_as_that_of_the_robot_and_drains_as_fleet_yaml_says():
    assert volts(simulated(), 5, speed=0.3) == pytest.approx(volts(simulated(), 50, speed=0.3))
    drains = simulated(battery_policy={"endurance": 100.0})
    assert drains.what == "simulated waveshare-beast"
    begin = volts(simulated(), 5, speed=0.3)
    assert volts(drains, 30, speed=0.3) < begin - 10, "in hundredths of a volt"
    stands = simulated(battery_policy={"endurance": 100.0})
    assert volts(stands, 30, speed=0.0) == pytest.approx(begin, abs=1)
