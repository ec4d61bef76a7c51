"""A quadruped's fields in fleet.yaml."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from fleet import AdapterConfig, BodyPart, BusText, CameraText, ExistingPath, NewPath
from fleet.sim.faults import parse_faults
from fleet_quadruped.any_description import load_body
from fleet_quadruped.robot.description import EXAMPLE, DogDescription
from fleet_quadruped.robot.drawing import body_parts
from fleet_quadruped.sim.faults import ALL_FAULTS, WALKER_FAULTS
from fleet_quadruped.sim.worlds import WORLDS


def simulation(link: str) -> tuple[str, dict[str, float]]:
    """Return world and faults of ``sim:WORLD?faults=...``; raises ValueError with an example."""
    scheme, _, rest = link.partition(":")
    world, _, query = rest.partition("?")
    if scheme != "sim" or world not in WORLDS or (query and not query.startswith("faults=")):
        worlds = ", ".join(WORLDS)
        raise ValueError(
            f"{link!r} is not a simulated dog; write sim:auto or sim:mujoco?faults=loss:0.05 ({worlds})"
        )
    return world, parse_faults(query.removeprefix("faults="), {**WALKER_FAULTS, **ALL_FAULTS})


def _checked(link: str) -> str:
    simulation(link)
    return link


class QuadrupedConfig(AdapterConfig):
    """A quadruped's fields in fleet.yaml: a real robot has ``buses``, a simulated one ``link``."""

    adapter: Literal["quadruped"]
    body: ExistingPath | None = Field(
        None, description="The dog's description, a YAML file; left out, the example dog."
    )
    buses: dict[str, BusText] = Field(
        {}, description="Each bus of the description and where it is, like {a: can:socketcan:can0}."
    )
    link: Annotated[str, AfterValidator(_checked)] | None = Field(
        None, description="A simulated dog: sim:auto, sim:mujoco or sim:kinematic, with ?faults=loss:0.05."
    )
    trim: float = Field(1.0, gt=0.5, lt=2.0, description="Real distance over leg odometry, measured once.")
    camera: CameraText | None = Field(None, description="Where take_photo gets a JPEG picture.")

    captures: NewPath | None = Field(
        None,
        description="Folder for the bus traffic before each of the last 5 faults, 1 MB each. "
        "Left out: fleet/captures/<name> in XDG_STATE_HOME, ~/.local/state.",
    )

    @model_validator(mode="after")
    def _real_or_simulated(self) -> QuadrupedConfig:
        """Refuse a robot that is both real and simulated, or neither."""
        if bool(self.buses) == (self.link is not None):
            raise ValueError("give either buses (a real dog) or link: sim:auto (a simulated one)")
        return self

    @property
    def body_file(self) -> Path:
        """The description to load: the configured one, else that of the example robot."""
        return self.body or EXAMPLE

    def body_parts(self) -> tuple[BodyPart, ...]:
        """Return trunk and legs; nothing for a self-walking machine, whose parts are unknown."""
        dog = load_body(self.body_file)
        return body_parts(dog) if isinstance(dog, DogDescription) else ()

    @property
    def captures_folder(self) -> Path:
        """Folder of the captures: the configured one, else one of this robot in the state folder."""
        states = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
        return self.captures or Path(states) / "fleet" / "captures" / self.name
