"""Sections of a quadruped's description as pydantic models, in metres, radians, seconds, N m, kilograms."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from fleet_quadruped.frames import FrameMap

PositiveNumber = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    """Return a pair of limits; raises ValueError unless the first is smaller."""
    if pair[0] >= pair[1]:
        raise ValueError(f"the first of {list(pair)} must be the smaller one")
    return pair


RisingRange = Annotated[tuple[float, float], AfterValidator(_rising)]


class Section(BaseModel):
    """Base of all sections: frozen, unknown keys refused, numbers finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Machine(Section):
    """The robot as a whole."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_-]{0,62}$", description="Name in logs and faults.")
    mass: PositiveNumber = Field(description="Total mass, kg.")


class Geometry(Section):
    """Positions of the legs and lengths of their links."""

    hip_x: PositiveNumber = Field(description="Body centre to the abduction axes, forward, m.")
    hip_y: PositiveNumber = Field(description="Body centre to the abduction axes, sideways, m.")
    abad_offset: PositiveNumber = Field(description="Abduction axis to the plane of the leg, m.")
    thigh: PositiveNumber = Field(description="Hip axis to knee axis, m.")
    calf: PositiveNumber = Field(description="Knee axis to the centre of the foot, m.")
    foot_radius: PositiveNumber = Field(description="Radius of the round foot, m.")
    front_knees: Literal["backward", "forward"] = Field(
        "backward", description="Direction in which they point."
    )
    rear_knees: Literal["backward", "forward"] = Field(
        "backward", description="Direction in which they point."
    )


class CanBusConfig(Section):
    """One CAN bus."""

    bitrate: int = Field(1_000_000, gt=0, description="bit/s.")
    data_bitrate: int | None = Field(
        None, gt=0, description="CAN FD: bit/s of the data phase; unset: classic CAN."
    )


class Temperature(Section):
    """Manufacturer-specific object with a drive's temperature: 16 bits, signed."""

    index: int = Field(ge=0x2000, le=0x9FFF, description="Index, like 0x2031.")
    sub: int = Field(0, ge=0, le=255, description="Subindex.")
    scale: PositiveNumber = Field(1.0, description="Degrees C of one unit.")

    @property
    def entry(self) -> int:
        """Entry in a PDO mapping."""
        return self.index << 16 | self.sub << 8 | 16


class Motor(Section):
    """An MIT motor: the ranges and fields of its frames, from its manual."""

    angle: PositiveNumber = Field(description="Greatest angle in its frames, in both directions, rad.")
    speed: PositiveNumber = Field(description="Greatest speed, rad/s.")
    torque: PositiveNumber = Field(description="Greatest torque, N m.")
    kp: PositiveNumber = Field(500, description="Greatest stiffness, N m/rad.")
    kd: PositiveNumber = Field(5, description="Greatest damping, N m s/rad.")
    damiao: bool = Field(False, description="Has a status in its replies, registers and a watchdog.")
    temperature_at: Literal[6, 7] | None = Field(
        None, description="Byte of its replies that holds the temperature."
    )
    coldest: int = Field(0, ge=-100, le=0, description="Temperature of a zero in that byte, degrees C.")
    error_at: Literal[6, 7] | None = Field(None, description="Byte of its replies that holds an error code.")


class Endpoints(Section):
    """ODrive: endpoint numbers of its parameters, from the flat_endpoints.json of its firmware version."""

    enable_watchdog: int = Field(ge=0, le=0xFFFF, description="axis0.config.enable_watchdog.")
    watchdog_timeout: int = Field(ge=0, le=0xFFFF, description="axis0.config.watchdog_timeout.")


class Drive(Section):
    """Protocol and timing of the joint drives."""

    protocol: str = Field(description="cia402, mit, odrive, moteus, or one from a plugin package.")
    profile: str = Field("", description="MIT: motor model, which determines the ranges in its frames.")
    profiles: dict[str, Motor] = Field({}, description="MIT: further motor models by name.")
    endpoints: Endpoints | None = Field(
        None, description="ODrive: endpoints of the watchdog; if unset, configure it in odrivetool."
    )
    eds: str = Field("", description="CiA 402: EDS file; it must contain every object used.")
    vendor: int | None = Field(None, description="CiA 402: required vendor ID (1018h:1).")
    product: int | None = Field(None, description="CiA 402: required product code (1018h:2).")
    temperature: Temperature | None = Field(
        None, description="CiA 402: vendor object with the temperature; if unset, heat does not slow it."
    )
    cycle_hz: int = Field(100, ge=20, le=1000, description="Control cycles per second.")
    timeout: float = Field(0.1, gt=0, le=1, description="Silence after which a drive stops on its own, s.")
    heartbeat: float = Field(0.05, gt=0, le=1, description="CiA 402: period of the heartbeats, s.")


class Actuator(Section):
    """Common properties of the joints of one kind. Limits are for a left leg; abduction is mirrored."""

    limits: RisingRange = Field(description="Lowest and highest angle, rad.")
    velocity: PositiveNumber = Field(description="Highest speed, rad/s.")
    torque: PositiveNumber = Field(description="Highest torque, N m.")
    profile: str = Field("", description="MIT: motor model of these joints, if not drive.profile.")
    kp: float = Field(60, ge=0, description="MIT, ODrive, moteus: stiffness, N m/rad.")
    kd: float = Field(2, ge=0, description="MIT, ODrive, moteus: damping, N m s/rad.")
    ratio: PositiveNumber = Field(1, description="Motor turns per turn of the joint.")
    counts_per_rad: PositiveNumber = Field(
        10_000, description="CiA 402: position units per rad of the motor."
    )
    rated_torque: PositiveNumber = Field(
        10, description="CiA 402: torque of the joint at 1000 per mille, N m."
    )
    temperature_warn: float = Field(70, description="Temperature from which the robot slows down, degrees C.")
    temperature_max: float = Field(85, description="Temperature at which the robot sits down, degrees C.")


class Wiring(Section):
    """Bus, address and mounting of one joint's drive."""

    bus: str = Field(description="Name of its bus.")
    id: int = Field(ge=1, le=127, description="Node ID or motor ID.")
    sign: Literal[-1, 1] = Field(1, description="-1 if the motor turns opposite to the joint.")
    offset: float = Field(0.0, description="Motor angle at joint zero, divided by the ratio, rad.")


class Pace(Section):
    """Limits of velocity and acceleration."""

    speed: PositiveNumber = Field(0.8, description="Highest forward speed, m/s.")
    strafe: PositiveNumber = Field(0.3, description="Highest sideways speed, m/s.")
    turn: PositiveNumber = Field(1.0, description="Highest turning speed, rad/s.")
    acceleration: PositiveNumber = Field(0.8, description="m/s2.")
    turn_acceleration: PositiveNumber = Field(2.5, description="rad/s2.")


class WalkGait(Pace):
    """The slow gait, with three feet on the ground."""

    speed: PositiveNumber = Field(0.15, description="Highest forward speed, m/s.")
    strafe: PositiveNumber = Field(0.08, description="Highest sideways speed, m/s.")
    turn: PositiveNumber = Field(0.35, description="Highest turning speed, rad/s.")
    acceleration: PositiveNumber = Field(0.3, description="m/s2.")
    turn_acceleration: PositiveNumber = Field(0.75, description="rad/s2.")
    period: float = Field(1.4, gt=0.5, le=5, description="Duration of one cycle of four steps, s.")
    sway: float = Field(
        0.5, ge=0.3, le=0.7, description="How far the body sways towards the standing side, as a share."
    )


class Gait(Pace):
    """Dimensions and timing of the trot; ``walk`` is the slow gait."""

    height: PositiveNumber = Field(0.27, description="Height of the hip axes while standing, m.")
    lowest: PositiveNumber = Field(0.15, description="Lowest standing height, m.")
    highest: PositiveNumber = Field(0.32, description="Highest standing height, m.")
    period: float = Field(0.42, gt=0.1, le=2, description="Duration of one trot cycle, s.")
    duty: float = Field(0.58, ge=0.5, lt=0.9, description="Share of the cycle that a foot is on the ground.")
    swing: PositiveNumber = Field(0.06, description="Height to which a foot is lifted, m.")
    reach: PositiveNumber = Field(
        0.16, description="Greatest distance of a foot from its neutral position, m."
    )
    walk: WalkGait = Field(WalkGait(), description="Gait ``walk`` of the velocity contract.")
    posture: Share = Field(0.5, description="How strongly the legs level the body.")


class LegPose(Section):
    """Angles of a left leg; the right leg mirrors them."""

    abad: float
    hip: float
    knee: float


class Poses(Section):
    """Named postures."""

    fold: LegPose = Field(description="Legs folded under the lying body.")
    roll_near: LegPose | None = Field(
        None, description="Rolling over: legs on the side that it rolls towards."
    )
    roll_far: LegPose | None = Field(None, description="Rolling over: legs on the other side.")
    rise_time: PositiveNumber = Field(1.5, description="Duration of standing up from ``fold``, s.")
    sit_time: PositiveNumber = Field(1.2, description="Duration of sitting down, s.")


class Sensor(Section):
    """Values received in CAN frames."""

    bus: str = Field(description="Name of the bus.")
    frames: tuple[FrameMap, ...] = Field(min_length=1, description="Frames and the values in them.")
    timeout: PositiveNumber = Field(0.1, description="Silence after which the values are stale, s.")


class DogBattery(Sensor):
    """The battery's frames and thresholds."""

    timeout: PositiveNumber = Field(5.0, description="Silence after which the values are stale, s.")
    warn: float = Field(25, ge=0, le=100, description="Percent at which health becomes degraded.")
    sit_at: float = Field(10, ge=0, le=100, description="Percent at which the robot sits down.")


class Switch(Section):
    """A lamp, turned on and off by two frames."""

    bus: str
    id: int = Field(ge=0, le=0x7FF)
    on: str = Field(pattern=r"^([0-9a-fA-F]{2}){1,8}$", description="Data that turns it on, hex.")
    off: str = Field(pattern=r"^([0-9a-fA-F]{2}){1,8}$", description="Data that turns it off, hex.")


class WatchLimits(Section):
    """Limits that apply to any quadruped, also a self-walking machine."""

    deadman: float = Field(
        0.5, ge=0.1, le=5, description="Time without an order until the robot stands still, s."
    )
    abandoned: float = Field(
        10.0, ge=1, le=600, description="Time without its host until the robot sits down, s."
    )
    tilt: float = Field(0.785, gt=0.1, le=1.5, description="Tilt at which the drives damp, rad.")


class Safety(WatchLimits):
    """Limits and timing of safety stops."""

    following: float = Field(0.35, gt=0, le=1.5, description="Greatest following error, rad.")
    following_time: float = Field(
        0.1, gt=0, le=1, description="Time for which the following error may be exceeded, s."
    )
    step: float = Field(0.2, gt=0, le=1, description="Largest change of a target in one cycle, rad.")
    margin: float = Field(0.035, ge=0, le=0.2, description="Distance of targets from joint limits, rad.")
    joint_reach: float = Field(
        0.1, gt=0, le=0.1, description="Greatest distance of a joint from its position at joint_mode, rad."
    )
    joint_speed: float = Field(0.3, gt=0, le=1, description="Speed of joints in joint_mode, rad/s.")
    kd: float = Field(3.0, gt=0, le=5, description="Damping of the emergency stop, N m s/rad.")
    damp_time: float = Field(
        2.0,
        ge=1.5,
        le=10,
        description="Duration of damping or lowering in a hard stop, until torque is switched off, s.",
    )
    lowest_voltage: float | None = Field(
        None, gt=0, description="Supply voltage of the drives (else the battery) at which it sits down, V."
    )
    stale_cycles: int = Field(5, ge=2, le=50, description="Cycles without feedback until the drives damp.")
