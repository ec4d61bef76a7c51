"""Sections of a quadruped's description as pydantic models, in metres, radians, seconds, N m, kilograms."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from fleet_quadruped.frames import FrameMap

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    """Return a pair of limits; raises ValueError unless the first is smaller."""
    if pair[0] >= pair[1]:
        raise ValueError(f"the first of {list(pair)} must be the smaller one")
    return pair


Range = Annotated[tuple[float, float], AfterValidator(_rising)]


class Section(BaseModel):
    """Base of all sections: frozen, unknown keys refused, numbers finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Machine(Section):
    """The robot as a whole."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_-]{0,62}$", description="Its name, in logs and faults.")
    mass: Positive = Field(description="Total mass, kg.")


class Geometry(Section):
    """Positions of the legs and lengths of their links."""

    hip_x: Positive = Field(description="Body centre to the abduction axes, forward, m.")
    hip_y: Positive = Field(description="Body centre to the abduction axes, sideways, m.")
    abad_offset: Positive = Field(description="Abduction axis to the plane of the leg, m.")
    thigh: Positive = Field(description="Hip axis to knee axis, m.")
    calf: Positive = Field(description="Knee axis to the centre of the foot, m.")
    foot_radius: Positive = Field(description="Radius of the round foot, m.")
    front_knees: Literal["backward", "forward"] = Field("backward", description="Where they point.")
    rear_knees: Literal["backward", "forward"] = Field("backward", description="Where they point.")


class Bus(Section):
    """One CAN bus."""

    bitrate: int = Field(1_000_000, gt=0, description="bit/s.")
    data_bitrate: int | None = Field(None, gt=0, description="CAN FD: bit/s of the data; none: classic CAN.")


class Temperature(Section):
    """Manufacturer-specific object with a drive's temperature: 16 bits, signed."""

    index: int = Field(ge=0x2000, le=0x9FFF, description="Index, like 0x2031.")
    sub: int = Field(0, ge=0, le=255, description="Subindex.")
    scale: Positive = Field(1.0, description="Degrees C of one unit.")

    @property
    def entry(self) -> int:
        """Entry in a PDO mapping."""
        return self.index << 16 | self.sub << 8 | 16


class Motor(Section):
    """An MIT motor: the ranges and fields of its frames, from its manual."""

    angle: Positive = Field(description="Greatest angle of its frames, both ways, rad.")
    speed: Positive = Field(description="Greatest speed, rad/s.")
    torque: Positive = Field(description="Greatest torque, N m.")
    kp: Positive = Field(500, description="Greatest stiffness, N m/rad.")
    kd: Positive = Field(5, description="Greatest damping, N m s/rad.")
    damiao: bool = Field(False, description="Status in its replies, registers, a watchdog of its own.")
    temperature_at: Literal[6, 7] | None = Field(
        None, description="Byte of its replies with the temperature."
    )
    coldest: int = Field(0, ge=-100, le=0, description="Degrees C that a zero in that byte means.")
    error_at: Literal[6, 7] | None = Field(None, description="Byte of its replies with an error number.")


class Endpoints(Section):
    """ODrive: endpoint numbers of its parameters, from the flat_endpoints.json of its firmware version."""

    enable_watchdog: int = Field(ge=0, le=0xFFFF, description="axis0.config.enable_watchdog.")
    watchdog_timeout: int = Field(ge=0, le=0xFFFF, description="axis0.config.watchdog_timeout.")


class Drive(Section):
    """Protocol and timing of the joint drives."""

    protocol: str = Field(description="cia402, mit, odrive, moteus, or one that a package brings.")
    profile: str = Field("", description="MIT: the motor, which fixes the ranges of its frames.")
    profiles: dict[str, Motor] = Field({}, description="MIT: motors that are not built in, by their names.")
    endpoints: Endpoints | None = Field(
        None, description="ODrive: where its watchdog is set; without it, set it in odrivetool."
    )
    eds: str = Field("", description="CiA 402: an EDS file; every object that is used must be in it.")
    vendor: int | None = Field(None, description="CiA 402: the vendor in object 1018h:1 that must be there.")
    product: int | None = Field(None, description="CiA 402: the product in 1018h:2 that must be there.")
    temperature: Temperature | None = Field(
        None, description="CiA 402: the maker's object with the temperature; without it heat slows nothing."
    )
    cycle_hz: int = Field(100, ge=20, le=1000, description="Control cycles a second.")
    timeout: float = Field(0.1, gt=0, le=1, description="Silence after which a drive stops itself, s.")
    heartbeat: float = Field(0.05, gt=0, le=1, description="CiA 402: period of the heartbeats, s.")


class Actuator(Section):
    """Common properties of the joints of one kind. Limits are for a left leg; abduction is mirrored."""

    limits: Range = Field(description="Least and greatest angle, rad.")
    velocity: Positive = Field(description="Highest speed, rad/s.")
    torque: Positive = Field(description="Highest torque, N m.")
    profile: str = Field("", description="MIT: the motor of these joints, where it is not drive.profile.")
    kp: float = Field(60, ge=0, description="MIT, ODrive, moteus: stiffness, N m/rad.")
    kd: float = Field(2, ge=0, description="MIT, ODrive, moteus: damping, N m s/rad.")
    ratio: Positive = Field(1, description="Motor turns for one turn of the joint.")
    counts_per_rad: Positive = Field(10_000, description="CiA 402: position units for one rad of the motor.")
    rated_torque: Positive = Field(10, description="CiA 402: torque of the joint at 1000 per mille, N m.")
    temperature_warn: float = Field(70, description="Degrees C from which the dog slows down.")
    temperature_max: float = Field(85, description="Degrees C at which it sits down.")


class Wiring(Section):
    """Bus, address and mounting of one joint's drive."""

    bus: str = Field(description="Name of its bus.")
    id: int = Field(ge=1, le=127, description="Node id, or motor id.")
    sign: Literal[-1, 1] = Field(1, description="-1 when the motor turns against the joint.")
    offset: float = Field(0.0, description="Motor angle at joint zero, over the ratio, rad.")


class Pace(Section):
    """Limits of velocity and acceleration."""

    speed: Positive = Field(0.8, description="Highest forward speed, m/s.")
    strafe: Positive = Field(0.3, description="Highest sideways speed, m/s.")
    turn: Positive = Field(1.0, description="Highest turning speed, rad/s.")
    acceleration: Positive = Field(0.8, description="m/s2.")
    turn_acceleration: Positive = Field(2.5, description="rad/s2.")


class Walk(Pace):
    """The slow gait, with three feet on the ground."""

    speed: Positive = Field(0.15, description="Highest forward speed, m/s.")
    strafe: Positive = Field(0.08, description="Highest sideways speed, m/s.")
    turn: Positive = Field(0.35, description="Highest turning speed, rad/s.")
    acceleration: Positive = Field(0.3, description="m/s2.")
    turn_acceleration: Positive = Field(0.75, description="rad/s2.")
    period: float = Field(1.4, gt=0.5, le=5, description="Seconds for one full cycle of four steps.")
    sway: float = Field(
        0.5, ge=0.3, le=0.7, description="How far it presses towards the standing feet of a side, as a share."
    )


class Gait(Pace):
    """Dimensions and timing of the trot; ``walk`` is the slow gait."""

    height: Positive = Field(0.27, description="Hip axes above the ground while standing, m.")
    lowest: Positive = Field(0.15, description="Lowest standing height, m.")
    highest: Positive = Field(0.32, description="Highest standing height, m.")
    period: float = Field(0.42, gt=0.1, le=2, description="Seconds for one full trot cycle.")
    duty: float = Field(0.58, ge=0.5, lt=0.9, description="Share of the cycle a foot is on the ground.")
    swing: Positive = Field(0.06, description="How high a foot is lifted, m.")
    reach: Positive = Field(0.16, description="Farthest step from the neutral place, m.")
    walk: Walk = Field(Walk(), description="The gait walk of the velocity contract.")
    posture: Share = Field(0.5, description="How strongly the legs level the body.")


class Pose(Section):
    """Angles of a left leg; the right leg mirrors them."""

    abad: float
    hip: float
    knee: float


class Poses(Section):
    """Named postures."""

    fold: Pose = Field(description="Legs folded under the body: where it lies.")
    roll_near: Pose | None = Field(None, description="Rolling over: the legs of the side it rolls to.")
    roll_far: Pose | None = Field(None, description="Rolling over: the legs of the other side.")
    rise_time: Positive = Field(1.5, description="Seconds to stand up from the fold.")
    sit_time: Positive = Field(1.2, description="Seconds to sit down.")


class Sensor(Section):
    """Values received in CAN frames."""

    bus: str = Field(description="Name of the bus.")
    frames: tuple[FrameMap, ...] = Field(min_length=1, description="Which frames, and what is in them.")
    timeout: Positive = Field(0.1, description="Silence after which the values are stale, s.")


class Battery(Sensor):
    """The battery's frames and thresholds."""

    timeout: Positive = Field(5.0, description="Silence after which the values are stale, s.")
    warn: float = Field(25, ge=0, le=100, description="Percent from which health is degraded.")
    sit_at: float = Field(10, ge=0, le=100, description="Percent at which it sits down.")


class Switch(Section):
    """A lamp, turned on and off by two frames."""

    bus: str
    id: int = Field(ge=0, le=0x7FF)
    on: str = Field(pattern=r"^([0-9a-fA-F]{2}){1,8}$", description="Data that turns it on, hex.")
    off: str = Field(pattern=r"^([0-9a-fA-F]{2}){1,8}$", description="Data that turns it off, hex.")


class Watch(Section):
    """Limits that apply to any quadruped, also a self-walking machine."""

    deadman: float = Field(0.5, ge=0.1, le=5, description="Seconds without an order until it stands still.")
    abandoned: float = Field(10.0, ge=1, le=600, description="Seconds without its host until it sits down.")
    tilt: float = Field(0.785, gt=0.1, le=1.5, description="Tilt at which it lets go, rad.")


class Safety(Watch):
    """Limits and timing of safety stops."""

    following: float = Field(0.35, gt=0, le=1.5, description="Farthest from wanted to actual, rad.")
    following_time: float = Field(0.1, gt=0, le=1, description="Seconds it may be beyond that.")
    step: float = Field(0.2, gt=0, le=1, description="Largest change of a target in one cycle, rad.")
    margin: float = Field(0.035, ge=0, le=0.2, description="Kept between targets and joint limits, rad.")
    joint_reach: float = Field(
        0.1, gt=0, le=0.1, description="Farthest that a joint is led from the posture of joint_mode, rad."
    )
    joint_speed: float = Field(0.3, gt=0, le=1, description="Speed at which joints are led, rad/s.")
    kd: float = Field(3.0, gt=0, le=5, description="Damping of the emergency stop, N m s/rad.")
    damp_time: float = Field(
        2.0,
        ge=1.5,
        le=10,
        description="Seconds of a hard stop, giving way or lowering, until torque goes off.",
    )
    lowest_voltage: float | None = Field(
        None, gt=0, description="Supply of the drives (else of the battery) at which it sits down, V."
    )
    stale_cycles: int = Field(5, ge=2, le=50, description="Cycles without feedback until it lets go.")
