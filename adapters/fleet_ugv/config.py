"""Config model of a wheeled robot in fleet.yaml."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator, model_validator

from fleet import AdapterConfig, CameraText, LinkRefused, Model, Positive, parse_link_url
from fleet_ugv.battery import checked_curve
from fleet_ugv.codecs.arduino import Servo
from fleet_ugv.kinematics import Ackermann, Differential, Kinematics
from fleet_ugv.odometry import Scale
from fleet_ugv.profiles import PROFILES, BaseProfile, CodecSettings
from fleet_ugv.sim.spec import BOARDS, spec_of

MODULES = {"none": 0, "arm": 1, "pan-tilt": 2}


def _checked_link(text: str) -> str:
    """Return a valid link; raises ValueError, which pydantic reports with its position."""
    kind, _, rest = text.partition(":")
    if kind == "sim":
        if rest.partition("?")[0] not in BOARDS:
            raise ValueError(
                f"{text!r}: the simulated bases are {', '.join(f'sim:{name}' for name in BOARDS)}"
            )
        spec_of(text, ticks=0.0, diameter=0.0)
        return text
    try:
        parse_link_url(text)
    except LinkRefused as error:
        raise ValueError(str(error)) from None
    return text


def _possible_factor(factor: float) -> float:
    """Return a plausible factor; raises ValueError, which pydantic reports with its position."""
    if not 0.1 <= abs(factor) <= 10.0:
        raise ValueError("a factor is 0.1 to 10, or -10 to -0.1")
    return factor


Factor = Annotated[float, AfterValidator(_possible_factor)]


class Calibration(Model):
    """Calibration measured on this individual robot; written by ``fleet calibrate``."""

    track: Positive | None = Field(None, description="Effective track, m: the base of turn rates.")
    left: Factor = Field(
        1.0, description="True metres per reported metre of the left side; negative: reversed counter."
    )
    right: Factor = Field(1.0, description="The same of the right side.")
    gyro: Factor = Field(1.0, description="Factor of the gyro's yaw rate; negative turns it over.")


class SteeringConfig(Model):
    """Front wheels steered by a servo (profile ros-arduino)."""

    wheelbase: Positive = Field(description="Between the axles, m.")
    sharpest: float = Field(0.5, gt=0, lt=1.4, description="Largest angle of the front wheels, rad.")
    servo: int = Field(0, ge=0, le=7, description="Number of the servo.")
    centre: float = Field(90.0, ge=0, le=180, description="Servo angle for straight ahead, degrees.")
    gain: float = Field(57.3, description="Degrees of the servo for one radian to the left.")


class UgvConfig(AdapterConfig):
    """A wheeled or tracked base on a serial line."""

    adapter: Literal["ugv"]
    profile: str = Field(description=f"What the base is: {', '.join(PROFILES)}.")
    link: Annotated[str, AfterValidator(_checked_link)] = Field(
        description="serial:/dev/serial/by-id/...?baud=115200, tcp:HOST:PORT, or sim:PROFILE."
    )
    module: Literal["none", "arm", "pan-tilt"] = Field(
        "none", description="What is mounted on it (Waveshare)."
    )
    firmware_timeout: float = Field(
        0.5, ge=0.3, le=3.0, description="Seconds after which the board stops by itself, where it can be set."
    )
    unguarded_speed: float = Field(
        0.15,
        gt=0,
        le=1.0,
        description="m/s of a wheel while the board's own stop is not confirmed.",
    )
    calibration: Calibration = Field(Calibration(), description="Measured on this robot.")
    wheel_diameter: Positive | None = Field(None, description="Over the profile's, m.")
    ticks_per_metre: Positive | None = Field(None, description="Encoder ticks a metre (ros-arduino).")
    steering: SteeringConfig | None = Field(None, description="For a robot that steers like a car.")
    battery: list[tuple[float, float]] | None = Field(
        None, description="Points of (volts, percent), rising; over the profile's curve."
    )
    camera: CameraText | None = Field(None, description="Where take_photo gets a JPEG picture.")

    def identity(self) -> str | None:
        """Return the identity of the machine, to find duplicate entries: its link, without the baud rate."""
        return None if self.link.startswith("sim:") else self.link.partition("?")[0]

    @field_validator("profile")
    @classmethod
    def _known(cls, profile: str) -> str:
        """Return the profile; raises ValueError for an unknown one."""
        known = cls.profiles()
        if profile not in known:
            raise ValueError(f"there is no profile {profile!r}; there are {', '.join(known)}")
        return profile

    @model_validator(mode="after")
    def _possible(self) -> UgvConfig:
        """Check combinations of fields; raises ValueError."""
        if self.steering is not None and self.profile != "ros-arduino":
            raise ValueError(f"steering: the profile {self.profile} steers by its wheels")
        if self.battery is not None:
            checked_curve(self.battery)
        self.__dict__["limits"] = self.limits.over(self.base.limits)
        return self

    @classmethod
    def profiles(cls) -> dict[str, BaseProfile]:
        """Return the profiles that ``profile`` may name."""
        return dict(PROFILES)

    @property
    def failsafe_after(self) -> float | None:
        """Seconds after which the board stops the wheels by itself; None where it does not."""
        settable = self.base.settable and self.base.timeout is not None
        return self.firmware_timeout if settable else self.base.timeout

    @property
    def base(self) -> BaseProfile:
        """The profile of this robot."""
        return self.profiles()[self.profile]

    @property
    def setting(self) -> CodecSettings:
        """Settings for its codec."""
        steers = self.steering
        return CodecSettings(
            timeout=self.firmware_timeout,
            module=MODULES[self.module],
            ticks=self.ticks_per_metre or self.base.ticks,
            diameter=self.wheel_diameter or self.base.diameter,
            servo=None if steers is None else Servo(steers.servo, steers.centre, steers.gain),
        )

    @property
    def track(self) -> float:
        """The effective track, m."""
        return self.calibration.track or self.base.track

    @property
    def kinematics(self) -> Kinematics:
        """Kinematics of its wheels."""
        left, right = abs(self.calibration.left), abs(self.calibration.right)  # the sign is the counter's
        steers = self.steering
        if steers is not None:
            return Ackermann(steers.wheelbase, steers.sharpest, self.base.fastest, (left + right) / 2)
        return Differential(self.track, self.base.fastest, left, right)

    @property
    def scale(self) -> Scale:
        """Scale of its counters and its gyro."""
        given = self.calibration
        wrap = None if self.base.counter is None else self.base.counter / self.setting.ticks
        return Scale(self.track, given.left, given.right, given.gyro, wrap)
