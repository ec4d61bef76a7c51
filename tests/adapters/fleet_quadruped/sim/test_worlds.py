"""Simulated worlds by their names, with and without physics."""

import importlib.util

import pytest

from fleet import LinkRefused
from fleet_quadruped.sim.world import KinematicWorld
from fleet_quadruped.sim.worlds import WORLDS, make_world


@pytest.fixture
def without_mujoco(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "mujoco" else find(name))


def test_a_kinematic_world_needs_nothing(dog, without_mujoco):
    assert type(make_world("kinematic", dog)) is KinematicWorld


def test_the_best_world_has_physics_where_they_are_installed(dog):
    pytest.importorskip("mujoco")
    assert type(make_world("auto", dog)).__name__ == type(make_world("mujoco", dog)).__name__ == "MujocoWorld"


def test_the_best_world_has_no_physics_where_they_are_not_installed(dog, without_mujoco):
    assert type(make_world("auto", dog)) is KinematicWorld


def test_physics_that_are_not_installed_are_refused_with_what_to_install(dog, without_mujoco):
    with pytest.raises(LinkRefused) as caught:
        make_world("mujoco", dog)
    assert str(caught.value) == "sim:mujoco needs zenoh-fleet[sim]; or use sim:kinematic"


@pytest.mark.parametrize("name", ["moon", "", "Auto"])
def test_a_world_that_nobody_knows_is_refused_with_those_that_there_are(dog, name):
    with pytest.raises(LinkRefused) as caught:
        make_world(name, dog)
    assert str(caught.value) == f"there is no simulated world {name!r}; there are {', '.join(WORLDS)}"
