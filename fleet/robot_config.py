"""Fields that every robot has in fleet.yaml; the config of an adapter adds its own.

Pydantic models: frozen, unknown keys refused, every field described. The configuration reference in docs/ is
generated from the descriptions.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self
from uuid import UUID

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from fleet.model.body import BodyPart
from fleet.model.polygon import is_simple
from fleet.wire.topic_rules import TopicsConfig
from fleet.yaml_model import Model, wrong

__all__ = [
    "MAIN",
    "Accepts",
    "AdapterConfig",
    "Limits",
    "Model",
    "Name",
    "Positive",
    "Separation",
    "SourceType",
    "WorldOrigin",
]

ANY_VEHICLE: frozenset[str] = frozenset()
"""The plans of a robot that can fly any, or none."""
MAIN = "main"
"""The worker name of the edge's own process."""

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,62}$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Limits(Model):
    """Motion limits of a robot; a setpoint beyond them is clamped, a goal refused."""

    speed: Positive | None = Field(None, description="Horizontal speed, m/s.")
    vertical_speed: Positive | None = Field(None, description="Climb and descent speed, m/s.")
    yaw_rate: Positive | None = Field(None, description="Turning speed, rad/s.")
    altitude: Positive | None = Field(None, description="Highest altitude above home, m.")
    distance: Positive | None = Field(None, description="Farthest distance from home, m.")

    def over(self, other: Limits) -> Limits:
        """Return these limits, completed from ``other``."""
        given = {name: value for name, value in self if value is not None}
        return other.model_copy(update=given) if given else other


class Separation(Model):
    """Minimum distance between the robots of one edge; each kind of robot has its own defaults."""

    radius: Positive | None = Field(
        None,
        description="Radius around the robot's centre in metres, including the error of its position. Two "
        "robots are kept apart by the sum of their radii. Left out: 1.5 for mavlink, 0.6 for "
        "quadruped, 0.4 for ugv, 1.0 for adapters without a value.",
    )
    braking: Positive | None = Field(
        None,
        description="Guaranteed deceleration, m/s2. Left out: 1.5 for mavlink, 1.0 for quadruped and ugv, "
        "0.5 for adapters without a value.",
    )
    precedence: int | None = Field(
        None,
        ge=0,
        le=9,
        description="Of two robots in conflict, the one with the lower value gives way. Left out: 3 for "
        "mavlink, 2 for ugv and adapters without a value, 1 for quadruped.",
    )

    def over(self, other: Separation) -> Separation:
        """Return this separation, completed from ``other``."""
        given = {name: value for name, value in self if value is not None}
        return other.model_copy(update=given) if given else other


SourceType = Literal["edge", "edge_leader", "edge_follower", "tele", "edit", "sim", "sim_tele"]


class Accepts(Model):
    """Source types that this robot obeys; stops are obeyed from any source."""

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
    mission: frozenset[SourceType] | None = Field(
        None,
        description="For missions in which it takes part, in addition to the permission for each step. "
        "Left out: only local operators.",
    )


class WorldOrigin(Model):
    """The place on Earth of the origin of this robot's world frame."""

    latitude: float = Field(ge=-90, le=90, description="Degrees, WGS-84.")
    longitude: float = Field(ge=-180, le=180, description="Degrees, WGS-84.")
    altitude: float = Field(0.0, description="Metres above mean sea level.")
    heading: float = Field(
        0.0, ge=-360, le=360, description="Compass heading of the world's +y axis, degrees."
    )


def _simple(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Refuse a polygon that has crossing sides or no area."""
    if not is_simple(corners):
        raise ValueError("the sides of a polygon must not cross, and it must have an area")
    return corners


Corner = tuple[float, float]
Corners = Annotated[tuple[Corner, ...], Field(min_length=3, max_length=100), AfterValidator(_simple)]


def _bracketed(given: object) -> object:
    """Validate the nesting of the brackets, so that a missing one is one error, not one per number."""
    polygons = _as_tuples(given)
    for number, polygon in enumerate(polygons if isinstance(polygons, tuple) else (), 1):
        corners = polygon if isinstance(polygon, tuple) else (polygon,)
        flat = all(isinstance(corner, tuple) for corner in corners)
        if not flat or any(isinstance(value, tuple) for corner in corners for value in corner):
            raise ValueError(
                f"a bracket is missing or too many in polygon {number}: a list of polygons, each a list of "
                "corners, is written as [[[0, 0], [9, 0], [9, 9]]]"
            )
    return polygons


def _as_tuples(value: object) -> object:
    """Convert lists to tuples: after a validator of our own, pydantic accepts no list for a tuple."""
    return tuple(map(_as_tuples, value)) if isinstance(value, list | tuple) else value


Polygons = Annotated[tuple[Corners, ...], Field(max_length=20), BeforeValidator(_bracketed)]


class FenceConfig(Model):
    """Where a robot may be. Its limits define how high and how far from home."""

    frame: Literal["world", "geodetic"] = Field(
        "world",
        description="Meaning of the corners: [x, y] metres in the world frame, or [latitude, longitude].",
    )
    inclusion: Polygons = Field(
        (),
        description="Polygons of 3 to 100 corners, as in [[[0, 0], [9, 0], [9, 9]]]; the robot must be "
        "inside one.",
    )
    exclusion: Polygons = Field(
        (), description="Polygons, as in [[[0, 0], [9, 0], [9, 9]]]; the robot must be outside of all."
    )
    margin: float = Field(1.0, ge=0, le=100, description="Metres that a held velocity keeps from the border.")

    @model_validator(mode="after")
    def _on_earth(self) -> Self:
        """Refuse geodetic corners that are not valid degrees."""
        corners = [corner for polygon in (*self.inclusion, *self.exclusion) for corner in polygon]
        if self.frame == "geodetic" and any(abs(lat) >= 90 or abs(lon) > 180 for lat, lon in corners):
            raise ValueError("geodetic corners are [latitude, longitude] in degrees")
        return self


Percent = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]


class BatteryPolicy(Model):
    """Reaction to a low battery; the autopilot's own fail-safe remains active."""

    reserve: Percent = Field(
        15.0,
        description="Percent that must be left at home; goals and take-offs beyond are refused. "
        "A take-off needs more than `low` as well.",
    )
    endurance: Positive | None = Field(
        None, description="Seconds of motion on a full battery; for the way to a goal and home."
    )
    low: Percent = Field(
        20.0,
        description="Percent at which the action is executed, once. If it is below `reserve`, the robot "
        "arrives home below its reserve.",
    )
    action: Literal["return_to_home", "land", "stop", "warn"] = Field(
        "warn",
        description="Action for a robot that moves on the edge's command: a command, or only a warning.",
    )


class AdapterConfig(TopicsConfig):
    """The fields of every robot. An adapter subclasses it and adds ``adapter: Literal["name"]``."""

    name: Name = Field(description="The robot's name, used in commands, keys and logs.")
    twin: UUID = Field(description="The uuid of the robot's twin in the cloud.")
    worker: Name | None = Field(
        None,
        description="Run this robot in the worker process of this name; robots that name the same worker "
        "share it. Left out: the edge's own process, or for a drop-in file a worker of its own. main: the "
        "edge's own process, for a drop-in file too.",
    )
    role: Literal["leader", "follower"] | None = Field(
        None,
        description="For one of two arms that move together: the source type of its state is edge_leader "
        "or edge_follower; that of a simulated robot is still sim.",
    )
    follows: UUID | None = Field(
        None,
        description="The twin of the leader: the joints of this robot follow the leader's joints of the "
        "same names, from `follow_leader` until any stop. `accepts.command` must have "
        "edge_leader.",
    )
    accepts: Accepts = Field(Accepts(), description="Whose commands the robot obeys.")
    limits: Limits = Field(
        Limits(),
        description="They take precedence over the adapter's own limits, also where they are higher.",
    )
    fence: FenceConfig | None = Field(None, description="Where the robot may be.")
    battery_policy: BatteryPolicy | None = Field(
        None, description="Reaction to a low battery; left out: none."
    )
    setpoint_lease: float = Field(
        0.5,
        ge=0.15,
        le=5.0,
        description="Seconds for which a velocity is held, unless its message says otherwise.",
    )
    max_age: float = Field(0.5, gt=0, le=60, description="Oldest velocity that is obeyed, seconds.")
    command_max_age: float = Field(
        5.0, gt=0, le=600, description="Oldest discrete command or goal that is obeyed, seconds."
    )
    clock_skew: float = Field(
        0.3,
        ge=0,
        le=3600,
        description="How far a sender's clock may be off, and a stream of velocities late, seconds. "
        "`fleet ps --json` shows each sender's.",
    )
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
    origin: WorldOrigin | None = Field(
        None, description="World origin; left out, the robot's home is the origin."
    )
    start: tuple[float, float, float] | None = Field(
        None,
        description="[x, y, heading] for a robot without GPS: its position when the edge starts, metres "
        "east and north of the site's origin, and the direction of its front, radians "
        "counter-clockwise from east. It places the robot in the site's frame; without it, "
        "its distance to other robots is unknown.",
    )
    separation: Separation = Field(
        Separation(), description="How far other robots of this edge are kept from it."
    )

    @model_validator(mode="after")
    def _placed_once(self) -> Self:
        """Refuse a start beside an origin, and a start heading that must be in degrees."""
        if self.start is None:
            return self
        if self.origin is not None:
            raise wrong("start", "origin places the robot already; leave one of the two out")
        if abs(self.start[2]) > math.tau:
            raise wrong("start", f"the heading counts in radians: {self.start[2]:g} is more than a turn")
        return self

    @model_validator(mode="after")
    def _leads_or_follows(self) -> Self:
        """Refuse a leader that follows, a robot that follows itself, and one that refuses its leader."""
        is_led = "edge_leader" in (self.accepts.command or ())
        if self.follows == self.twin:
            raise wrong("follows", "this is the robot's own twin: a robot cannot follow itself")
        if self.role == "leader" and self.follows is not None:
            raise wrong("follows", "role is leader: a leader is not led; leave one of the two out")
        if self.role == "leader" and is_led:
            raise wrong("accepts", "role is leader: it would follow its own state; leave edge_leader out")
        if self.follows is not None and not is_led:
            raise wrong("follows", "its leader is not obeyed: put edge_leader into accepts.command")
        return self

    def timeout_of(self, command: str) -> float | None:  # noqa: ARG002 - for overriders
        """Return the timeout of a command in seconds; None: as the adapter declares it."""
        return None

    def plans(self) -> frozenset[str]:
        """Return the autopilots and kinds of vehicle whose plans the robot can fly.

        In the terms of QGroundControl's plans: px4, ardupilot; multirotor, plane, vtol, rover. Empty: any.
        """
        return ANY_VEHICLE

    def body_parts(self) -> tuple[BodyPart, ...]:
        """Return the parts of the robot's body, for drawings; empty if not described."""
        return ()

    @property
    def failsafe_after(self) -> float | None:
        """Seconds within which the robot's own fail-safe ends motion without commands, or None.

        The standby edge of a pair moves a robot only after this time, or after a stop of its own.
        """
        return None

    @property
    def source_type(self) -> str:
        """The source type of the robot's own state."""
        if self.simulated:
            return "sim"
        return f"edge_{self.role}" if self.role else "edge"

    @property
    def simulated(self) -> bool:
        """True if the robot is a simulation: its ``link`` begins with ``sim:``."""
        return str(getattr(self, "link", "")).startswith("sim:")
