"""A description becomes the simulated machine of its kind, alone or on buses."""

import pytest

from fleet_quadruped.any_description import load_body
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.sim.dog import SimDog
from fleet_quadruped.sim.selfwalk import SimWalker
from fleet_quadruped.sim.simulated_machine import on_buses, simulated
from fleet_quadruped.sim.world import KinematicWorld


@pytest.fixture
def walker():
    return load_body(EXAMPLE.with_name("self-walking.yaml"))


def test_a_dog_lives_in_the_world_that_is_named(dog):
    machine = simulated(dog, "kinematic", {"a": lambda frame: None})
    assert (type(machine), type(machine.world)) == (SimDog, KinematicWorld)


@pytest.mark.parametrize("world", ["auto", "mujoco", "kinematic"])
def test_a_machine_that_walks_by_itself_has_no_physics(walker, world):
    assert type(simulated(walker, world, {"a": lambda frame: None})) is SimWalker


@pytest.mark.parametrize("kind", ["dog", "walker"])
def test_its_frames_arrive_on_its_buses_and_ours_reach_it(dog, walker, kind):
    machine, buses = on_buses(dog if kind == "dog" else walker, "kinematic")
    assert list(buses) == ["a"]
    buses["a"].receive(0.0)
    machine.advance(0.02)
    assert buses["a"].receive(0.0)
    machine.fault("silent")
    machine.advance(0.02)
    assert buses["a"].receive(0.0) == []
    machine.fault("loss", 1.0)
    if kind == "walker":
        machine._wires.faults.clear()
        buses["a"].send(walker.wire.commands["stand_up"])
        assert machine.mode.value == "rising"
