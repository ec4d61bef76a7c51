"""Worlds for simulated robots, by name."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet import LinkRefused
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.sim.world import KinematicWorld, World


def _mujoco(dog: DogDescription) -> World:
    if importlib.util.find_spec("mujoco") is None:
        raise LinkRefused("sim:mujoco needs zenoh-fleet[sim]; or use sim:kinematic")
    from fleet_quadruped.sim.mujoco_world import MujocoWorld  # noqa: PLC0415 - optional dependency

    return MujocoWorld(dog)


def _best(dog: DogDescription) -> World:
    return _mujoco(dog) if importlib.util.find_spec("mujoco") else KinematicWorld(dog)


WORLDS: Mapping[str, Callable[[DogDescription], World]] = MappingProxyType(
    {"mujoco": _mujoco, "kinematic": KinematicWorld, "auto": _best}
)


def make_world(name: str, dog: DogDescription) -> World:
    """Return a world; ``auto`` has physics if MuJoCo is installed. Raises LinkRefused for others."""
    if name not in WORLDS:
        raise LinkRefused(f"there is no simulated world {name!r}; there are {', '.join(WORLDS)}")
    return WORLDS[name](dog)
