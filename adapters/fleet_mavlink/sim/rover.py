"""ArduRover 4.6.3 as recorded: its modes, its motor, its home and what it reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot import ArduPilot
from fleet_mavlink.sim.ardupilot_status import ArduPilotStatus
from fleet_mavlink.sim.autopilot import Boot, CommandHandler
from fleet_mavlink.sim.home import SimHome
from fleet_mavlink.sim.land_detector import LandDetector
from fleet_mavlink.sim.manoeuvres import Idle
from fleet_mavlink.sim.message_output import INFO
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.physics import Agility
from fleet_mavlink.sim.rover_commands import COMMANDS
from fleet_mavlink.sim.rover_failsafes import RoverFailsafes
from fleet_mavlink.sim.rover_guided import RoverGuided
from fleet_mavlink.sim.rover_modes import MODES
from fleet_mavlink.sim.rover_moves import DISARMED, Coast
from fleet_mavlink.sim.rover_physics import WheeledBody
from fleet_mavlink.sim.speeds import ArduPilotSpeeds

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


class RoverHome(SimHome):
    """Home of one ArduRover, at an altitude of 0.14 m until the first disarming (``true_altitude``)."""

    def __init__(self, pilot: SimArduRover) -> None:
        super().__init__(pilot)
        self.true_altitude = False

    def set_here(self) -> None:
        """Set home here; its altitude only after the first disarming."""
        super().set_here()
        if self.place is not None and not self.true_altitude:
            self.place = (self.place[0], self.place[1], 0.14)


class RoverStatus(ArduPilotStatus):
    """Health of one ArduRover."""

    def state(self) -> int:
        """Return a state independent of arming: ACTIVE except during the start and in HOLD."""
        mode = self._pilot.mode
        if mode.name == "INITIALISING":
            return int(mav.MAV_STATE_CALIBRATING)
        standby = mode.name in _STANDBY_MODES
        return int(mav.MAV_STATE_STANDBY if standby else mav.MAV_STATE_ACTIVE)


class RoverLandDetector(LandDetector):
    """Land detector of one ArduRover, which has none."""

    def state(self) -> int:
        """Return UNDEFINED, always."""
        return 0


class SimArduRover(ArduPilot):
    """ArduRover."""

    vehicle_type: ClassVar[int] = int(mav.MAV_TYPE_GROUND_ROVER)
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    first_mode: ClassVar[str] = "INITIALISING"
    switched_mode: ClassVar[str] = "MANUAL"
    parts: ClassVar[Parts] = replace(
        ArduPilot.parts,
        speeds=RoverSpeeds,
        status=RoverStatus,
        setpoints=RoverGuided,
        failsafes=RoverFailsafes,
        land_detector=RoverLandDetector,
        home=RoverHome,
    )
    agility: ClassVar[Agility] = Agility(1.15, 1.0, 1.05)
    body: WheeledBody
    home: RoverHome

    def __init__(self, boot: Boot) -> None:
        super().__init__(boot)
        self._arrival_reported = False
        self.reversed = False  # by DO_SET_REVERSE, until the mode changes
        self.body.skid = int(boot.params["SERVO1_FUNCTION"]) == _THROTTLE_LEFT

    def arm(self) -> None:
        """Start the motor; home is unchanged."""
        home = self.home.place
        super().arm()
        self.home.place = home

    def disarm(self) -> None:
        """Take the drive away: it coasts."""
        was_armed = self.armed
        super().disarm()
        if was_armed:
            self.home.true_altitude = True
            self.home.set_here()
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

    def watch_idle(self) -> None:
        """Stay armed; report the arrival on the way home once."""
        if self.mode.name == "RTL" and self.manoeuvre.done and not self._arrival_reported:
            self._arrival_reported = True
            self.say(INFO, "Reached destination")

    def pilot_takes_over(self, mode: FlightMode) -> None:
        """Change to a mode by the switch of the remote control."""
        self.enter(mode)
