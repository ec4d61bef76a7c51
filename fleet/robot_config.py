"""What fleet.yaml may say of any robot; an adapter's own config adds its fields to these.

Pydantic models: frozen, unknown keys refused, every field described (the reference in docs/ is made
from the descriptions).
"""

from __future__ import annotations

from typing import Annotated, Literal
from uuid import UUID

from pydantic import Field

from fleet.topic_rules import Topics
from fleet.yaml_model import Model

__all__ = ["Accepts", "AdapterConfig", "Limits", "Model", "Name", "Origin", "Positive", "SourceType"]

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,62}$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Limits(Model):
    """How far a robot may go in anybody's hands; a setpoint beyond is clamped, a goal refused."""

    speed: Positive | None = Field(None, description="Horizontal speed, m/s.")
    vertical_speed: Positive | None = Field(None, description="Climb and descent speed, m/s.")
    yaw_rate: Positive | None = Field(None, description="Turning speed, rad/s.")
    altitude: Positive | None = Field(None, description="Highest altitude above home, m.")
    distance: Positive | None = Field(None, description="Farthest distance from home, m.")

    def over(self, other: Limits) -> Limits:
        """Return these limits with what they leave open taken from ``other``."""
        given = {name: value for name, value in self if value is not None}
        return other.model_copy(update=given)


SourceType = Literal["edge", "edge_leader", "edge_follower", "tele", "edit", "sim", "sim_tele"]


class Accepts(Model):
    """Which source types this robot obeys; stops are obeyed from anyone."""

    command: frozenset[SourceType] | None = Field(
        None,
        description="For commands and setpoints. Left out: [tele] for a real robot, "
        "[sim_tele, sim] for a simulated one.",
    )
    navigate: frozenset[SourceType] | None = Field(
        None,
        description="For navigation. Left out: [tele, edge] for a real robot, "
        "[sim_tele, sim] for a simulated one.",
    )


class Origin(Model):
    """The place on Earth where this robot's world frame has its origin."""

    latitude: float = Field(ge=-90, le=90, description="Degrees, WGS-84.")
    longitude: float = Field(ge=-180, le=180, description="Degrees, WGS-84.")
    altitude: float = Field(0.0, description="Metres above mean sea level.")
    heading: float = Field(
        0.0, ge=-360, le=360, description="Compass heading of the world's +y axis, degrees."
    )


class AdapterConfig(Topics):
    """The fields of every robot. An adapter subclasses it and adds ``adapter: Literal["name"]``."""

    name: Name = Field(description="The robot's name, used in commands, keys and logs.")
    twin: UUID = Field(description="The uuid of the robot's twin in the cloud.")
    worker: Name | None = Field(
        None,
        description="Run this robot in the worker process of this name; "
        "robots that name the same worker share it.",
    )
    accepts: Accepts = Field(Accepts(), description="Whose commands the robot obeys.")
    limits: Limits = Field(Limits(), description="Over the adapter's own limits.")
    setpoint_lease: float = Field(
        0.5, ge=0.15, le=5.0, description="Seconds a velocity is held unless it says otherwise."
    )
    max_age: float = Field(0.5, gt=0, le=60, description="Oldest velocity that is obeyed, seconds.")
    command_max_age: float = Field(
        5.0, gt=0, le=600, description="Oldest discrete command or goal that is obeyed, seconds."
    )
    clock_skew: float = Field(2.0, ge=0, le=3600, description="How far a sender's clock may be off, seconds.")
    control_lease: float = Field(
        3.0,
        ge=0,
        le=600,
        description="Seconds after its last motion for which one operator keeps the robot.",
    )
    rotation_order: Literal["auto", "wxyz", "xyzw"] = Field(
        "auto",
        description="Order of list rotations in goals; auto: xyzw in navigate_to_pose, "
        "wxyz in goto and path.",
    )
    legacy_status: bool = Field(
        True,
        description="Answer commands that have no Response Topic with a status message.",
    )
    origin: Origin | None = Field(None, description="World origin; left out, the robot's home is the origin.")

    def timeout_of(self, command: str) -> float | None:  # noqa: ARG002 - for those that let it be said
        """Return the seconds until a command is given up, None: as the adapter declares it."""
        return None

    @property
    def simulated(self) -> bool:
        """True when the robot is a simulation: its ``link`` begins with ``sim:``."""
        return str(getattr(self, "link", "")).startswith("sim:")
