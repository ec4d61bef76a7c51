"""Config model of a MAVLink robot in fleet.yaml."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, SecretStr, field_validator

from fleet import AdapterConfig, LinkRefused, Model, parse_link_url
from fleet_mavlink.failsafes import Keeping, LinkLoss
from fleet_mavlink.remote_id_config import RemoteIdConfig
from fleet_mavlink.sim.spec import VehicleSpec
from fleet_mavlink.watcher_config import WatcherConfig


def _checked_link(text: str) -> str:
    """Return a valid link; raises ValueError, which pydantic reports with its place."""
    if text.startswith("sim:"):
        VehicleSpec.parse(text)
        return text
    try:
        parse_link_url(text)
    except LinkRefused as error:
        raise ValueError(str(error)) from None
    return text


class Rates(Model):
    """Rates of reports, Hz."""

    pose: float = Field(10.0, ge=1, le=40, description="Position and attitude, Hz.")
    gps: float = Field(1.0, gt=0, le=2, description="Satellite fix, Hz.")
    battery: float = Field(0.5, ge=0.2, le=1, description="Battery, Hz.")
    state: float = Field(1.0, ge=0.2, le=5, description="Flight state and vehicle state, Hz.")
    metrics: float = Field(0.5, gt=0, le=2, description="Numbers for people, Hz.")
    imu: float = Field(5.0, ge=0, le=50, description="Body rates and acceleration, Hz; 0: never.")
    motors: float = Field(2.0, ge=0, le=20, description="Motors as joints, Hz; only with motor_joints.")


class Timeouts(Model):
    """Timeouts of commands, seconds."""

    answer: float = Field(1.0, ge=0.1, le=10, description="For an answer, until a command is sent again.")
    tries: int = Field(4, ge=1, le=10, description="How often a command is sent at the most.")
    working: float = Field(5.0, ge=1, le=120, description="For the next acknowledgement after IN_PROGRESS.")
    takeoff: float = Field(90.0, ge=5, le=3600, description="For a take-off.")
    land: float = Field(300.0, ge=5, le=3600, description="For a landing.")
    return_to_home: float = Field(600.0, ge=5, le=7200, description="For a flight home.")


_TIMED = frozenset({"takeoff", "land", "return_to_home"})


class MavlinkConfig(AdapterConfig):
    """A multirotor, plane or VTOL, or a rover or boat on ArduPilot; others are only monitored and stopped."""

    adapter: Literal["mavlink"]
    link: Annotated[str, AfterValidator(_checked_link)] = Field(
        description="udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, serial:DEVICE?baud=N, "
        "sim:px4 or sim:ardupilot."
    )
    backup_links: tuple[Annotated[str, AfterValidator(_checked_link)], ...] = Field(
        (),
        max_length=3,
        description="More links to the same vehicle, in the order in which they are used when nothing is "
        "received on those before; none of them sim:.",
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
    timeouts: Timeouts = Field(Timeouts(), description="Timeouts of commands.")
    motor_joints: tuple[str, ...] = Field(
        (), max_length=4, description="The twin's joints that are the motors, in the autopilot's order."
    )
    takeoff_altitude: float = Field(
        5.0, ge=1, le=120, description="Metres above home for a take-off that does not say."
    )

    failsafes: Keeping | None = Field(
        None,
        description="The autopilot's fail-safe parameters: check reports wrong values, set also corrects "
        "them, ignore does neither. Left out: check for a real vehicle, set for a simulated one.",
    )
    link_loss: LinkLoss = Field(
        "return_to_home",
        description="Action of the autopilot when it receives nothing more from this edge.",
    )
    signing_key: SecretStr | None = Field(
        None,
        min_length=8,
        description="Key of MAVLink 2 signing, as !secret: a passphrase, or 64 hex digits. What the vehicle "
        "sends must then be signed with it.",
    )
    accept_unsigned: bool = Field(
        False, description="Believe unsigned frames too, until the command setup_signing gave it the key."
    )
    allow_kill: bool = Field(
        False, description="Allow the command kill, which stops the motors in the air too: it falls."
    )

    watchers: tuple[WatcherConfig, ...] = Field(
        (), max_length=4, description="Ground stations that see the vehicle through this edge."
    )

    traffic: Literal["off", "send"] = Field(
        "off",
        description="send: the autopilot gets the positions of the other aircraft of this process as ADS-B "
        "messages. Its own parameters define how it reacts.",
    )
    remote_id: RemoteIdConfig | None = Field(
        None,
        description="For the aircraft's Remote ID transmitter; without its consent there is no take-off.",
    )

    @field_validator("start")
    @classmethod
    def _on_earth(cls, start: tuple[float, float, float] | None) -> None:
        """Raise ValueError for a start: the world frame begins at its home, wherever that is set."""
        if start is not None:
            raise ValueError("an aircraft is placed by its home, which is on Earth; leave start out")

    @field_validator("backup_links")
    @classmethod
    def _real(cls, links: tuple[str, ...]) -> tuple[str, ...]:
        """Raise ValueError for a simulated link: a simulator cannot be a redundant link to a vehicle."""
        if any(link.startswith("sim:") for link in links):
            raise ValueError("a sim: link cannot be a backup link")
        return links

    def timeout_of(self, command: str) -> float | None:
        """Return the timeout of a command, s; None: the one declared by the adapter."""
        seconds: float | None = getattr(self.timeouts, command, None) if command in _TIMED else None
        return seconds

    def plans(self) -> frozenset[str]:
        """Return the vehicles that a plan may name; a simulated vehicle is defined by its link."""
        if not self.simulated:
            return frozenset({"ardupilot", "px4", "multirotor", "rover", "boat", "plane", "vtol"})
        spec = VehicleSpec.parse(self.link)
        return frozenset({spec.flavour, spec.vehicle})

    @property
    def keeping(self) -> Keeping:
        """Handling of the autopilot's fail-safe parameters."""
        return self.failsafes or ("set" if self.simulated else "check")

    def identity(self) -> str:
        """Return the identity of the vehicle, to find duplicate entries: link and system id."""
        if self.simulated:
            return f"{self.link} {self.name}"
        return f"{self.link} system {self.system_id}"
