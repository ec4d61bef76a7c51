"""Common part of the simulated autopilots: state, time, place, modes, motors.

No I/O and no clock: time comes in with ``tick``. ArduPilot and PX4 are subclasses that bring their
modes, commands and texts, and the parts that they are made of (``parts``): arming checks, reported status,
flight by setpoints, land detector, home, fence, fail-safes.
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
from fleet_mavlink.sim.fence import FenceMonitor
from fleet_mavlink.sim.local_frame import Geo, LocalFrame
from fleet_mavlink.sim.manoeuvres import TAKING_OFF, Idle, Manoeuvre, hold, place_of
from fleet_mavlink.sim.message_output import MessageOutput
from fleet_mavlink.sim.mission_flight import leave_mission
from fleet_mavlink.sim.missions import SimMissions
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.physics import Agility, Body
from fleet_mavlink.sim.satellites import GpsProfile, GpsReceiver
from fleet_mavlink.sim.streams import SimStreams
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


class Autopilot(MessageOutput, ABC):
    """One autopilot from boot to reboot. Times are seconds of the simulation."""

    autopilot_id: ClassVar[int]
    vehicle_type: ClassVar[int] = 2  # MAV_TYPE
    modes: ClassVar[Mapping[str, FlightMode]]
    capabilities: ClassVar[int]
    version: ClassVar[int]
    commands: ClassVar[Mapping[int, CommandHandler]]
    default_rates: ClassVar[Mapping[int, float]]
    starts_in: ClassVar[float]  # seconds of the real one from boot to the end of its start
    gps_profile: ClassVar[GpsProfile]
    parts: ClassVar[Parts]
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
        self.missions = boot.missions
        self.equipment = boot.equipment
        real = self.gps_profile.usable_after
        ready_after = real if boot.ready_after is None else boot.ready_after
        self.uptime = Uptime(lambda: self.time, pace=ready_after / real, epoch=boot.epoch)
        self.frame = LocalFrame(boot.place)
        self.gps = GpsReceiver(self.gps_profile, boot.params, boot.faults, self.uptime, lambda: self.time)
        self.streams = SimStreams(self.default_rates, boot.at + self.uptime.real_time(1.0))
        self.mode = mode
        self.manoeuvre: Manoeuvre = Idle()
        self.armed = False
        self.armed_at = 0.0
        self.failsafe = ""
        self.terminated = False
        self.gcs_heard_at: float | None = None
        self.reboot_requested = False
        parts = self.parts
        self.speeds = parts.speeds(boot.params)
        self.fence = FenceMonitor(self, parts.fence)
        self.home = parts.home(self)
        self.land_detector = parts.land_detector(self)
        self.arming = parts.arming(self)
        self.status = parts.status(self)
        self.setpoints = parts.setpoints(self)
        self.failsafes = parts.failsafes(self)

    # position

    def geo(self, off_east: float = 0.0) -> Geo:
        """Return the place of the vehicle, or the place ``off_east`` metres east of it."""
        north, east, down = place_of(self.body)
        return self.frame.geo_of((north, east + off_east, down))

    @property
    def remote_control(self) -> bool:
        """True while a pilot's remote control is received."""
        return "rc_loss" not in self.faults

    @property
    def initialised(self) -> bool:
        """True once the autopilot has finished its start."""
        return self.uptime.reached(self.starts_in)

    @property
    def has_position(self) -> bool:
        """True while the estimator has a usable position."""
        return not ("not_ready" in self.faults and not self.armed) and self.gps.usable

    # commands

    def command(self, request: CommandRequest) -> None:
        """Execute a command and acknowledge it."""
        handler = self.commands.get(request.command)
        result = handler(self, request) if handler else UNSUPPORTED
        if result is not None:
            self.acknowledge(request, result)

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

    def arm(self) -> None:
        """Start the motors."""
        self.armed = True
        self.armed_at = self.time
        self.land_detector.arm()
        self.home.set_here()

    def disarm(self) -> None:
        """Stop the motors."""
        self.armed = False
        self.manoeuvre = Idle()
        self.missions.disarmed()

    @property
    def flying(self) -> bool:
        """True while the vehicle is off the ground."""
        return not self.body.grounded

    def vtol_state(self) -> int:
        """Return MAV_VTOL_STATE; 0 for other vehicles."""
        return 0

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
        self.land_detector.watch()
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

    def pilot_takes_over(self, mode: FlightMode) -> None:
        """Change the mode by the switch of the remote control; the pilot then holds the vehicle in place."""
        self.mode = mode
        self.manoeuvre = hold(self) if self.armed else Idle()


def accept(_pilot: Autopilot, _request: CommandRequest) -> int:
    """Accept a command that changes nothing here."""
    return ACCEPTED
