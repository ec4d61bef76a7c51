"""What fleet.yaml says of a robot on MAVLink."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from fleet import AdapterConfig, LinkRefused
from fleet.link.url import parse
from fleet.robot_config import Model
from fleet_mavlink.failsafes import Keeping, LinkLoss
from fleet_mavlink.sim.spec import SimSpec


def _checked_link(text: str) -> str:
    """Return a good link; raises ValueError, which pydantic tells with its place."""
    if text.startswith("sim:"):
        SimSpec.parse(text)
        return text
    try:
        parse(text)
    except LinkRefused as error:
        raise ValueError(str(error)) from None
    return text


class Rates(Model):
    """How often things are reported, times a second."""

    pose: float = Field(10.0, ge=1, le=40, description="Position and attitude, Hz.")
    gps: float = Field(1.0, gt=0, le=2, description="Satellite fix, Hz.")
    battery: float = Field(0.5, ge=0.2, le=1, description="Battery, Hz.")
    state: float = Field(1.0, ge=0.2, le=5, description="Flight state and vehicle state, Hz.")
    metrics: float = Field(0.5, gt=0, le=2, description="Numbers for people, Hz.")


class MavlinkConfig(AdapterConfig):
    """A multirotor on ArduPilot or PX4."""

    adapter: Literal["mavlink"]
    link: Annotated[str, AfterValidator(_checked_link)] = Field(
        description="udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, serial:DEVICE?baud=N, "
        "sim:px4 or sim:ardupilot."
    )
    system_id: int = Field(1, ge=1, le=250, description="The vehicle's MAVLink system id.")
    own_system: int = Field(
        245,
        ge=1,
        le=254,
        description="Our own MAVLink system id; not 255, which ArduPilot watches for its ground station.",
    )
    own_component: int = Field(191, ge=1, le=255, description="Our own MAVLink component id.")
    rates: Rates = Field(Rates(), description="How often things are reported.")
    takeoff_altitude: float = Field(
        5.0, ge=1, le=120, description="Metres above home for a take-off that does not say."
    )

    failsafes: Keeping | None = Field(
        None,
        description="The autopilot's fail-safe parameters: check tells what is wrong, set also writes it, "
        "ignore does neither. Left out: check for a real vehicle, set for a simulated one.",
    )
    link_loss: LinkLoss = Field(
        "return_to_home",
        description="What the autopilot must do by itself when this edge is not heard any more.",
    )

    @property
    def keeping(self) -> Keeping:
        """What is done about the autopilot's fail-safe parameters."""
        return self.failsafes or ("set" if self.simulated else "check")

    def identity(self) -> str:
        """Return what makes this the same machine as another entry: the link and the system id."""
        if self.simulated:
            return f"{self.link} {self.name}"
        return f"{self.link} system {self.system_id}"
