"""What both simulated autopilots have in common: state, time, place, readiness, arming, landing.

No I/O and no clock: time comes in with ``tick``. ArduPilot and PX4 are subclasses that bring their
modes, commands, texts and fail-safes.
"""

from __future__ import annotations

import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from fleet import GeoOrigin, GeoPoint, Vector3, geo_from_world, world_from_geo
from fleet_mavlink.sim.battery import SimBattery
from fleet_mavlink.sim.command_request import ACCEPTED, UNSUPPORTED, CommandRequest
from fleet_mavlink.sim.equipment import Equipment
from fleet_mavlink.sim.manoeuvres import LANDING, ON_GROUND, TAKING_OFF, GoTo, Idle, Manoeuvre, hold, place_of
from fleet_mavlink.sim.mission_flight import leave_mission
from fleet_mavlink.sim.missions import SimMissions
from fleet_mavlink.sim.modes import Mode
from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.physics import Agility, Body
from fleet_mavlink.sim.satellites import Drift, Loss
from fleet_mavlink.sim.setpoints import Setpoint
from fleet_mavlink.sim.speaker import Speaker
from fleet_mavlink.sim.speeds import FlightSpeeds
from fleet_mavlink.sim.streams import SimStreams, home_position

Geo = tuple[float, float, float]  # degrees, degrees, metres above mean sea level
Handler = Callable[
    [Any, CommandRequest], "int | None"
]  # (autopilot, ask) -> MAV_RESULT; None: no acknowledgement


@dataclass(frozen=True, slots=True)
class Boot:
    """What an autopilot starts with; everything but the time stays over a reboot."""

    system_id: int
    place: Geo  # where it was put down
    ready_after: float | None  # seconds to a usable position, None: as long as the real one
    body: Body
    battery: SimBattery
    params: Params
    missions: SimMissions
    equipment: Equipment
    random: random.Random
    faults: Mapping[str, float]
    epoch: float  # Unix time at time 0
    at: float


class Autopilot(Speaker, ABC):
    """One autopilot from boot to reboot. Times are seconds of the simulation."""

    autopilot_id: ClassVar[int]
    vehicle_type: ClassVar[int] = 2  # MAV_TYPE
    modes: ClassVar[Mapping[str, Mode]]
    capabilities: ClassVar[int]
    version: ClassVar[int]
    commands: ClassVar[Mapping[int, Handler]]
    default_rates: ClassVar[Mapping[int, float]]
    real_ready: ClassVar[float]  # seconds from boot to a usable position
    gps_grace: ClassVar[float]  # seconds without GPS after which the position is no longer usable
    loss: ClassVar[Loss]
    gps_switch: ClassVar[tuple[str, float]]  # the parameter, and its value without satellites
    fix_type: ClassVar[int]
    speeds_type: ClassVar[type[FlightSpeeds]]
    spin_up: ClassVar[float]  # seconds from take-off to leaving the ground
    agility: ClassVar[Agility] = Agility(2.5, 2.5, 1.6)
    obeys_other_components: ClassVar[bool] = False
    obeys_broadcast: ClassVar[bool] = False
    without_gimbal: ClassVar[int | None]  # its answer to a gimbal's commands; None: it gives none

    def __init__(self, boot: Boot, mode: Mode) -> None:
        super().__init__(boot.random, boot.faults, boot.at)
        self.system_id = boot.system_id
        self.place = boot.place
        self.body = boot.body
        self.battery = boot.battery
        self.params = boot.params
        self.speeds = self.speeds_type(boot.params)
        self.missions = boot.missions
        self.equipment = boot.equipment
        self.booted_at = boot.at
        self._epoch = boot.epoch
        ready_after = self.real_ready if boot.ready_after is None else boot.ready_after
        self._pace = ready_after / self.real_ready
        self._origin = GeoOrigin(*boot.place)
        self.streams = SimStreams(self.default_rates, boot.at + self.real_time(1.0))
        self.mode = mode
        self.manoeuvre: Manoeuvre = Idle()
        self.armed = False
        self.armed_at = 0.0
        self.left_ground = False  # since it was armed
        self.touched_at: float | None = None
        self.home: Geo | None = None
        self.altitude_error = 0.0  # m by which its own estimate is too high
        self.failsafe = ""
        self.terminated = False
        self.gcs_heard_at: float | None = None
        self.gps_lost_at: float | None = None
        self.drift = Drift(self.loss)
        self.fence_broken = False
        self.reboot_asked = False

    # time

    def real_time(self, seconds: float) -> float:
        """Return when something happens that the real autopilot does ``seconds`` after boot."""
        return seconds * self._pace

    def age(self, real_seconds: float) -> bool:
        """Return True once the moment has come that the real one reaches ``real_seconds`` after boot."""
        return self.time - self.booted_at >= self.real_time(real_seconds)

    @property
    def boot_ms(self) -> int:
        """Milliseconds since boot."""
        return int((self.time - self.booted_at) * 1000) & 0xFFFFFFFF

    @property
    def boot_us(self) -> int:
        """Microseconds since boot."""
        return int((self.time - self.booted_at) * 1e6)

    @property
    def unix_time(self) -> float:
        """Unix seconds in the simulation."""
        return self._epoch + self.time

    # position

    def geo(self, off_east: float = 0.0) -> Geo:
        """Return where the vehicle is, or a place so many metres east of it."""
        north, east, down = place_of(self.body)
        return self.geo_of((north, east + off_east, down))

    def ned_of(self, latitude: float, longitude: float, altitude: float) -> tuple[float, float, float]:
        """Return the local position of a place on Earth (altitude above mean sea level)."""
        enu = world_from_geo(self._origin, GeoPoint(latitude, longitude, altitude - self.altitude_error))
        return enu.y, enu.x, -enu.z

    def geo_of(self, place: tuple[float, float, float]) -> Geo:
        """Return a local position as a place on Earth."""
        north, east, down = place
        point = geo_from_world(self._origin, Vector3(east, north, -down))
        return point.latitude, point.longitude, point.altitude + self.altitude_error

    def target(self) -> Geo | None:
        """Return the place that the vehicle flies to or holds, None while there is none."""
        flown = self.manoeuvre
        return self.geo_of(place_of(flown)) if isinstance(flown, GoTo) else None

    def down_of(self, altitude: float) -> float:
        """Return an altitude (m AMSL, as it is estimated) as a local position."""
        return self.place[2] + self.altitude_error - altitude

    def home_ned(self) -> tuple[float, float, float]:
        """Return home as a local position; where the vehicle was put down while home is unknown."""
        return self.ned_of(*self.home) if self.home is not None else (0.0, 0.0, 0.0)

    def height_over_home(self) -> float:
        """Return metres above home."""
        return self.home_ned()[2] - self.body.down

    def set_home(self) -> None:
        """Make the place of the vehicle its home and tell it."""
        self.home = self.geo()
        self.out.append(home_position(self))

    @property
    def gps_fix(self) -> bool:
        """True while the receiver has a position."""
        return self._gps_found and not self._gps_off

    @property
    def _gps_off(self) -> bool:
        return "gps_loss" in self.faults or self.params[self.gps_switch[0]] == self.gps_switch[1]

    @property
    def without_gps(self) -> float | None:
        """Seconds since the satellites were lost, None while there are some."""
        return None if self.gps_lost_at is None else self.time - self.gps_lost_at

    @property
    def remote_control(self) -> bool:
        """True while a pilot's remote control is heard."""
        return "rc_loss" not in self.faults

    @property
    @abstractmethod
    def _gps_found(self) -> bool:
        """True once the receiver has found satellites after boot."""

    @property
    @abstractmethod
    def initialised(self) -> bool:
        """True once the autopilot has finished its start."""

    @property
    def origin_set(self) -> bool:
        """True once the estimator has an origin; home comes with it."""
        return self.home is not None

    @property
    def has_position(self) -> bool:
        """True once the estimator uses GPS, and until it has been without for ``gps_grace``."""
        if "not_ready" in self.faults and not self.armed:
            return False
        lost = self.gps_lost_at is not None and self.time - self.gps_lost_at > self.gps_grace
        return self.age(self.real_ready) and not lost

    @abstractmethod
    def sensors(self) -> tuple[int, int, int]:
        """Return SYS_STATUS's sensors: present, enabled, healthy."""

    @abstractmethod
    def system_status(self) -> int:
        """Return HEARTBEAT's MAV_STATE."""

    # being asked

    def command(self, ask: CommandRequest) -> None:
        """Carry out a command and acknowledge it."""
        handler = self.commands.get(ask.command)
        result = handler(self, ask) if handler else UNSUPPORTED
        if result is not None:
            self.acknowledge(ask, result)

    @abstractmethod
    def setpoint(self, message: object) -> None:
        """Obey or ignore SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT."""

    @abstractmethod
    def fly_setpoint(self, setpoint: Setpoint) -> Manoeuvre:
        """Return the manoeuvre that a setpoint asks for."""

    def gcs_heartbeat(self, message: object) -> None:  # noqa: ARG002 - PX4 takes any
        """Note that a ground station is there."""
        self.gcs_heard_at = self.time

    # modes and arming

    def enter(self, mode: Mode) -> None:
        """Change to a mode and begin what it does; idle while the motors are off."""
        if self.runs_mission and mode is not self.mode:
            leave_mission(self)
        self.mode = mode
        self.manoeuvre = mode.enter(self) if self.armed else Idle()

    @property
    def runs_mission(self) -> bool:
        """True in the mode that flies the mission."""
        return self.mode.name in {"AUTO", "MISSION"}

    @abstractmethod
    def refusals(self, *, force: bool) -> list[str]:
        """Return why the motors cannot be armed now; empty: they can."""

    def arm(self) -> None:
        """Start the motors."""
        self.armed = True
        self.armed_at = self.time
        self.left_ground = False
        self.touched_at = None
        self.set_home()

    def disarm(self) -> None:
        """Stop the motors."""
        self.armed = False
        self.manoeuvre = Idle()
        self.missions.disarmed()

    @abstractmethod
    def outside_fence(self, place: tuple[float, float, float]) -> bool:
        """Return whether a local position (NED) is outside the fence that is switched on."""

    def watch_fence(self, breach: Callable[[], None]) -> None:
        """Call ``breach`` once when the flying vehicle leaves the fence."""
        body = self.body
        outside = self.outside_fence((body.north, body.east, body.down))
        if outside and not self.fence_broken:
            breach()
        self.fence_broken = outside

    @property
    def flying(self) -> bool:
        """True while the vehicle is off the ground."""
        return not self.body.grounded

    def vtol_state(self) -> int:
        """Return MAV_VTOL_STATE; 0 for what is no VTOL."""
        return 0

    @property
    def landed(self) -> bool:
        """True while the autopilot thinks that it stands on the ground."""
        return self.body.grounded

    def landed_state(self) -> int:
        """Return MAV_LANDED_STATE."""
        if self.landed:
            return ON_GROUND
        return self.manoeuvre.in_air_state if self.armed else LANDING

    @property
    def taking_off(self) -> bool:
        """True from the take-off command to the height it asked for."""
        return self.armed and self.manoeuvre.in_air_state == TAKING_OFF and not self.manoeuvre.done

    # time passes

    def tick(self, now: float, drift: tuple[float, float]) -> None:
        """Move on to ``now``, at most about 0.05 s ahead."""
        dt, self.time = now - self.time, now
        aim = self.manoeuvre.aim(self)
        if self.body.down < 0.0 or aim.thrust:
            self.body.advance(aim, self.agility, drift if self.flying else (0.0, 0.0), dt)
        self.drain(dt)
        self._watch_gps()
        self.drift.tick(self.without_gps, dt)
        self._watch_ground()
        self.supervise()
        self.say_what_is_due()
        self.out.extend(self.params.pending())
        self.out.extend(self.missions.overdue(now))
        self.out.extend(self.equipment.tick(self, dt))
        if self.age(1.0):
            self.out.extend(self.streams.due(self, now))

    def drain(self, dt: float) -> None:
        """Drain the battery."""
        self.battery.drain(self.armed and self.flying, dt)

    @abstractmethod
    def supervise(self) -> None:
        """Do what this autopilot does by itself: start-up, auto-disarm, fail-safes."""

    def _watch_gps(self) -> None:
        """Remember since when satellites are gone."""
        if self._gps_off:
            self.gps_lost_at = self.time if self.gps_lost_at is None else self.gps_lost_at
        else:
            self.gps_lost_at = None

    def _watch_ground(self) -> None:
        """Remember leaving and touching the ground."""
        if not self.landed:
            self.left_ground = self.left_ground or self.armed
            self.touched_at = None
        elif self.left_ground and self.touched_at is None:
            self.touched_at = self.time
            self.touched_ground()

    def touched_ground(self) -> None:
        """Say what there is to say at the touch-down."""

    def pilot_takes_over(self, mode: Mode) -> None:
        """Change to a mode by the switch of the remote control; the pilot holds the vehicle there."""
        self.mode = mode
        self.manoeuvre = hold(self) if self.armed else Idle()


def accept(_pilot: Autopilot, _ask: CommandRequest) -> int:
    """Accept a command that changes nothing here."""
    return ACCEPTED
