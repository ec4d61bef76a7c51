"""ArduRover 4.6.3 as recorded: how it drives, coasts and brakes, and its refusals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot import ArduPilot
from fleet_mavlink.sim.autopilot import Boot, CommandHandler
from fleet_mavlink.sim.manoeuvres import Idle, Manoeuvre
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.physics import Agility
from fleet_mavlink.sim.rover_commands import COMMANDS
from fleet_mavlink.sim.rover_failsafes import RoverFailsafes
from fleet_mavlink.sim.rover_modes import MODES
from fleet_mavlink.sim.rover_moves import BRAKED, DISARMED, Coast, DriveToPosition, Roll
from fleet_mavlink.sim.rover_physics import WheeledBody
from fleet_mavlink.sim.setpoints import ReceivedSetpoint, setpoint_of
from fleet_mavlink.sim.speaker import INFO
from fleet_mavlink.sim.speeds import ArduPilotSpeeds, FlightSpeeds

_BODY_FRAMES = frozenset({8, 9})
_RELATIVE_FRAMES = frozenset({3, 6, 10, 11})
_THROTTLE_LEFT = 73  # SERVO1_FUNCTION of a skid-steered vehicle
_STANDBY_MODES = frozenset({"HOLD"})


class RoverSpeeds(ArduPilotSpeeds):
    """WP_SPEED, m/s."""

    @property
    def cruise(self) -> float:
        """WP_SPEED."""
        return self.requested or self._params["WP_SPEED"]

    @property
    def yaw_follows_course(self) -> bool:
        """Always True."""
        return True


class SimArduRover(ArduPilot):
    """ArduRover. Its home keeps an altitude of 0.14 m until the first disarming."""

    vehicle_type: ClassVar[int] = int(mav.MAV_TYPE_GROUND_ROVER)
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    first_mode: ClassVar[str] = "INITIALISING"
    switched_mode: ClassVar[str] = "MANUAL"
    speeds_type: ClassVar[type[FlightSpeeds]] = RoverSpeeds
    agility: ClassVar[Agility] = Agility(1.15, 1.0, 1.05)
    body: WheeledBody

    def __init__(self, boot: Boot) -> None:
        super().__init__(boot)
        self._true_home = False
        self._arrival_reported = False
        self.reversed = False  # by DO_SET_REVERSE, until the mode changes
        self.failsafes = RoverFailsafes(self)
        self.body.skid = int(boot.params["SERVO1_FUNCTION"]) == _THROTTLE_LEFT

    def system_status(self) -> int:
        """Return a state independent of arming: ACTIVE except during the start and in HOLD."""
        if self.mode.name == "INITIALISING":
            return int(mav.MAV_STATE_CALIBRATING)
        standby = self.mode.name in _STANDBY_MODES
        return int(mav.MAV_STATE_STANDBY if standby else mav.MAV_STATE_ACTIVE)

    def landed_state(self) -> int:
        """Return UNDEFINED, always."""
        return 0

    def set_home(self) -> None:
        """Set home here; its altitude only after the first disarming."""
        super().set_home()
        if self.home is not None and not self._true_home:
            self.home = (self.home[0], self.home[1], 0.14)

    def arm(self) -> None:
        """Start the motor; home is unchanged."""
        home = self.home
        super().arm()
        self.home = home

    def disarm(self) -> None:
        """Take the drive away: it coasts."""
        was_armed = self.armed
        super().disarm()
        if was_armed:
            self._true_home = True
            self.set_home()
        self.manoeuvre = Coast(DISARMED)

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode; a disarmed rover keeps coasting."""
        self.reversed = False
        self.speeds.requested = None
        super().enter(mode)
        self._arrival_reported = False
        if isinstance(self.manoeuvre, Idle):
            self.manoeuvre = Coast(DISARMED)

    def refusal_of(self, mode: FlightMode) -> str:
        """Return why a mode cannot be entered now, empty if it can."""
        if mode.name == "AUTO" and self.armed and not self.missions.loaded:
            return "init failed"
        return "requires position" if self.armed and mode.position and not self.has_position else ""

    def setpoint(self, message: object) -> None:
        """Follow a setpoint in GUIDED; ignore it silently otherwise."""
        if self.mode.name == "GUIDED" and self.armed:
            self.manoeuvre = self.fly_setpoint(setpoint_of(message))

    def fly_setpoint(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the drive: with a yaw rate by the sign of the forward speed, else by turning the nose."""
        if setpoint.position is not None:
            return self._to_place(setpoint)
        vx, vy, _ = setpoint.velocity or (0.0, 0.0, 0.0)
        rate = setpoint.turn_rate
        speed = min(math.hypot(vx, vy), self.params["WP_SPEED"])
        if not setpoint.finite or (speed == 0.0 and not rate):
            return Coast(BRAKED)
        until = self.time + self.params["GUID_TIMEOUT"]
        if rate is not None:
            return Roll(math.copysign(speed, vx), None, rate, until)
        heading = math.atan2(vy, vx) + (self.body.heading if setpoint.frame in _BODY_FRAMES else 0.0)
        return Roll(speed, heading, 0.0, until)

    def _to_place(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the drive to a position: global above home, or local."""
        x, y, z = setpoint.position or (0.0, 0.0, 0.0)
        if setpoint.frame in _RELATIVE_FRAMES:
            x, y, _ = self.frame.ned_of(x, y, z)
        return DriveToPosition(x, y)

    def watch_idle(self) -> None:
        """Stay armed; report the arrival on the way home once."""
        if self.mode.name == "RTL" and self.manoeuvre.done and not self._arrival_reported:
            self._arrival_reported = True
            self.say(INFO, "Reached destination")

    def pilot_takes_over(self, mode: FlightMode) -> None:
        """Change to a mode by the switch of the remote control."""
        self.enter(mode)
