"""Common part of the simulated autopilots: state, time, place, readiness, arming, landing.

No I/O and no clock: time comes in with ``tick``. ArduPilot and PX4 are subclasses that bring their
modes, commands, texts and fail-safes.
"""

from __future__ import annotations

import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from fleet_mavlink.sim.battery import SimBattery
from fleet_mavlink.sim.command_request import ACCEPTED, UNSUPPORTED, CommandRequest
from fleet_mavlink.sim.equipment import Equipment
from fleet_mavlink.sim.local_frame import Geo, LocalFrame
from fleet_mavlink.sim.manoeuvres import (
    LANDING,
    ON_GROUND,
    TAKING_OFF,
    GoToManoeuvre,
    Idle,
    Manoeuvre,
    hold,
    place_of,
)
from fleet_mavlink.sim.mission_flight import leave_mission
from fleet_mavlink.sim.missions import SimMissions
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.physics import Agility, Body
from fleet_mavlink.sim.satellites import GpsReceiver, Loss
from fleet_mavlink.sim.setpoints import ReceivedSetpoint
from fleet_mavlink.sim.speaker import Speaker
from fleet_mavlink.sim.speeds import FlightSpeeds
from fleet_mavlink.sim.streams import SimStreams, home_position
from fleet_mavlink.sim.uptime import Uptime

CommandHandler = Callable[
    [Any, CommandRequest], "int | None"
]  # (autopilot, ask) -> MAV_RESULT; None: no acknowledgement


@dataclass(frozen=True, slots=True)
class Boot:
    """The initial state of an autopilot; all but the time is kept over a reboot."""

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
    modes: ClassVar[Mapping[str, FlightMode]]
    capabilities: ClassVar[int]
    version: ClassVar[int]
    commands: ClassVar[Mapping[int, CommandHandler]]
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
    without_gimbal: ClassVar[int | None]  # its result for gimbal commands; None: no answer

    def __init__(self, boot: Boot, mode: FlightMode) -> None:
        super().__init__(boot.random, boot.faults, boot.at)
        self.system_id = boot.system_id
        self.place = boot.place
        self.body = boot.body
        self.battery = boot.battery
        self.params = boot.params
        self.speeds = self.speeds_type(boot.params)
        self.missions = boot.missions
        self.equipment = boot.equipment
        ready_after = self.real_ready if boot.ready_after is None else boot.ready_after
        self.uptime = Uptime(lambda: self.time, pace=ready_after / self.real_ready, epoch=boot.epoch)
        self.frame = LocalFrame(boot.place)
        self.gps = GpsReceiver(
            self.loss, lambda: self.time, is_off=self._gps_off, found=lambda: self._gps_found
        )
        self.streams = SimStreams(self.default_rates, boot.at + self.uptime.real_time(1.0))
        self.mode = mode
        self.manoeuvre: Manoeuvre = Idle()
        self.armed = False
        self.armed_at = 0.0
        self.left_ground = False  # since it was armed
        self.touched_at: float | None = None
        self.home: Geo | None = None
        self.failsafe = ""
        self.terminated = False
        self.gcs_heard_at: float | None = None
        self.fence_broken = False
        self.reboot_requested = False

    # position

    def geo(self, off_east: float = 0.0) -> Geo:
        """Return the place of the vehicle, or the place ``off_east`` metres east of it."""
        north, east, down = place_of(self.body)
        return self.frame.geo_of((north, east + off_east, down))

    def target(self) -> Geo | None:
        """Return the place that the vehicle flies to or holds, None while there is none."""
        flown = self.manoeuvre
        return self.frame.geo_of(place_of(flown)) if isinstance(flown, GoToManoeuvre) else None

    def home_ned(self) -> tuple[float, float, float]:
        """Return home as a local position; where the vehicle was put down while home is unknown."""
        return self.frame.ned_of(*self.home) if self.home is not None else (0.0, 0.0, 0.0)

    def height_over_home(self) -> float:
        """Return metres above home."""
        return self.home_ned()[2] - self.body.down

    def set_home(self) -> None:
        """Make the place of the vehicle its home, and send HOME_POSITION."""
        self.home = self.geo()
        self.out.append(home_position(self))

    @property
    def remote_control(self) -> bool:
        """True while a pilot's remote control is received."""
        return "rc_loss" not in self.faults

    def _gps_off(self) -> bool:
        """Return True while the receiver is switched off, by a fault or by its parameter."""
        return "gps_loss" in self.faults or self.params[self.gps_switch[0]] == self.gps_switch[1]

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
        lost_for = self.gps.lost_for
        return self.uptime.reached(self.real_ready) and (lost_for is None or lost_for <= self.gps_grace)

    @abstractmethod
    def sensors(self) -> tuple[int, int, int]:
        """Return SYS_STATUS's sensors: present, enabled, healthy."""

    @abstractmethod
    def system_status(self) -> int:
        """Return HEARTBEAT's MAV_STATE."""

    # commands

    def command(self, request: CommandRequest) -> None:
        """Execute a command and acknowledge it."""
        handler = self.commands.get(request.command)
        result = handler(self, request) if handler else UNSUPPORTED
        if result is not None:
            self.acknowledge(request, result)

    @abstractmethod
    def setpoint(self, message: object) -> None:
        """Obey or ignore SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT."""

    @abstractmethod
    def fly_setpoint(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the manoeuvre that a setpoint asks for."""

    def gcs_heartbeat(self, message: object) -> None:  # noqa: ARG002 - PX4 takes any
        """Note a heartbeat of a ground station."""
        self.gcs_heard_at = self.time

    # modes and arming

    def enter(self, mode: FlightMode) -> None:
        """Change the mode and start its manoeuvre; idle while the motors are off."""
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
        """Return why the motors cannot be armed now; empty if they can."""

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
        """Return MAV_VTOL_STATE; 0 for other vehicles."""
        return 0

    @property
    def landed(self) -> bool:
        """True while the autopilot's land detector says so."""
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

    # passing of time

    def tick(self, now: float, drift: tuple[float, float]) -> None:
        """Move on to ``now``, at most about 0.05 s ahead."""
        dt, self.time = now - self.time, now
        aim = self.manoeuvre.aim(self)
        if self.body.down < 0.0 or aim.thrust:
            self.body.advance(aim, self.agility, drift if self.flying else (0.0, 0.0), dt)
        self.drain(dt)
        self.gps.tick(dt)
        self._watch_ground()
        self.supervise()
        self.send_due_texts()
        self.out.extend(self.params.pending())
        self.out.extend(self.missions.overdue(now))
        self.out.extend(self.equipment.tick(self, dt))
        if self.uptime.reached(1.0):
            self.out.extend(self.streams.due(self, now))

    def drain(self, dt: float) -> None:
        """Drain the battery."""
        self.battery.drain(self.armed and self.flying, dt)

    @abstractmethod
    def supervise(self) -> None:
        """Run what the autopilot does by itself: start-up, auto-disarm, fail-safes."""

    def _watch_ground(self) -> None:
        """Note take-off and touch-down."""
        if not self.landed:
            self.left_ground = self.left_ground or self.armed
            self.touched_at = None
        elif self.left_ground and self.touched_at is None:
            self.touched_at = self.time
            self.touched_ground()

    def touched_ground(self) -> None:
        """Send the text of a touch-down, if there is one."""

    def pilot_takes_over(self, mode: FlightMode) -> None:
        """Change the mode by the switch of the remote control; the pilot then holds the vehicle in place."""
        self.mode = mode
        self.manoeuvre = hold(self) if self.armed else Idle()


def accept(_pilot: Autopilot, _request: CommandRequest) -> int:
    """Accept a command that changes nothing here."""
    return ACCEPTED
