"""ArduCopter 4.6.3 as observed: start-up, modes, disarming by itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot_arming import ArduPilotArming
from fleet_mavlink.sim.ardupilot_commands import COMMANDS
from fleet_mavlink.sim.ardupilot_failsafes import ArduPilotFailsafes
from fleet_mavlink.sim.ardupilot_guided import ArduPilotGuided
from fleet_mavlink.sim.ardupilot_modes import MODES
from fleet_mavlink.sim.ardupilot_status import ArduPilotStatus
from fleet_mavlink.sim.autopilot import Autopilot, Boot, CommandHandler
from fleet_mavlink.sim.command_request import FAILED
from fleet_mavlink.sim.fence import FenceBounds
from fleet_mavlink.sim.manoeuvres import Land, Manoeuvre
from fleet_mavlink.sim.message_output import INFO, WARNING
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.satellites import ARDUPILOT_GPS, GpsProfile
from fleet_mavlink.sim.speeds import ArduPilotSpeeds
from fleet_mavlink.sim.streams import heartbeat

_LANDED_DISARM = 2.0
_SPOOLED_DOWN = 1.0  # s after which its motors idle in LAND on the ground


def _fence(params: Params) -> FenceBounds | None:
    """Return the bounds in FENCE_TYPE, if FENCE_ENABLE is set."""
    if not params["FENCE_ENABLE"]:
        return None
    return FenceBounds(int(params["FENCE_TYPE"]), params["FENCE_ALT_MAX"], params["FENCE_RADIUS"])


class ArduPilot(Autopilot):
    """ArduCopter."""

    autopilot_id: ClassVar[int] = int(mav.MAV_AUTOPILOT_ARDUPILOTMEGA)
    capabilities: ClassVar[int] = 0xFBEF
    version: ClassVar[int] = 0x040603FF
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    default_rates: ClassVar[Mapping[int, float]] = {mav.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
    starts_in: ClassVar[float] = 2.45  # until "ArduPilot Ready"
    gps_profile: ClassVar[GpsProfile] = ARDUPILOT_GPS
    parts: ClassVar[Parts] = Parts(
        speeds=ArduPilotSpeeds,
        fence=_fence,
        arming=ArduPilotArming,
        status=ArduPilotStatus,
        setpoints=ArduPilotGuided,
        failsafes=ArduPilotFailsafes,
    )
    spin_up: ClassVar[float] = 3.4
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    first_mode: ClassVar[str] = "STABILIZE"  # until the mode switch of the remote control is read
    switched_mode: ClassVar[str] = "STABILIZE"  # position of that switch
    without_gimbal: ClassVar[int | None] = FAILED
    obeys_other_components: ClassVar[bool] = True
    obeys_broadcast: ClassVar[bool] = True
    arming: ArduPilotArming
    failsafes: ArduPilotFailsafes

    def __init__(self, boot: Boot) -> None:
        super().__init__(boot, self.modes[self.first_mode])
        self._switch_read = False
        self.motors_stopped: Manoeuvre | None = None  # to resume when the emergency stop is released
        self.paused: Manoeuvre | None = None  # manoeuvre to resume after DO_PAUSE_CONTINUE

    # modes

    def refusal_of(self, mode: FlightMode) -> str:
        """Return why a mode cannot be entered now, empty if it can."""
        if not (self.armed and self.flying):
            return ""
        if mode.name == "AUTO" and not self.missions.loaded:
            return "init failed"
        return "requires position" if mode.position and not self.has_position else ""

    def change_mode(self, number: int) -> bool:
        """Enter the mode with this number and show it at once in a heartbeat; False if it is refused.

        The mode that it has is not entered again: its manoeuvre goes on.
        """
        mode = next((mode for mode in self.modes.values() if mode.custom == number), None)
        if mode is None:
            self.say(WARNING, f"No such mode {number}")
            return False
        if mode is self.mode:
            return True
        refusal = self.refusal_of(mode)
        if refusal:
            self.say(WARNING, f"Mode change to {mode.name} failed: {refusal}")
            return False
        self.enter(mode)
        self.out.append(heartbeat(self))
        return True

    def set_mode(self, message: Any) -> None:
        """Execute SET_MODE, which has no acknowledgement."""
        self.change_mode(message.custom_mode)

    # by itself

    def gcs_heartbeat(self, message: Any) -> None:
        """Process a station's heartbeat; only that of SYSID_MYGCS counts."""
        if message.get_srcSystem() != int(self.params["SYSID_MYGCS"]):
            return
        super().gcs_heartbeat(message)
        if self.failsafe == "gcs":
            self.failsafe = ""
            self.say(WARNING, "GCS Failsafe Cleared")

    def drain(self, dt: float) -> None:
        """Drain the battery; SIM_BATT_VOLTAGE is its upper limit."""
        super().drain(dt)
        self.battery.at_most(volts=self.params["SIM_BATT_VOLTAGE"])

    def supervise(self) -> None:
        """Start up, repeat the checks every second, disarm automatically, watch the fail-safes."""
        self._start_up()
        self.arming.watch()
        if self.armed:
            self.watch_idle()
        self.failsafes.watch()
        if self.runs_mission and getattr(self.manoeuvre, "returns", False):
            self.enter(self.modes["RTL"])
            self.out.append(heartbeat(self))

    def _start_up(self) -> None:
        """Report the steps of the start; the mode switch of the remote control resets the mode once."""
        if not self.initialised:
            return
        self.send_text_once(INFO, "ArduPilot Ready")
        if not self._switch_read and self.uptime.reached(2.6):
            self._switch_read = True
            self.enter(self.modes[self.switched_mode])
        if not self.home.known and self.uptime.reached(20.0) and self.gps.fix:
            self.send_text_once(INFO, "EKF3 IMU0 origin set")
            self.home.set_here()
        if self.has_position:
            self.send_text_once(INFO, "EKF3 IMU0 is using GPS")
        else:
            self.arming.repeat_refusals()

    def watch_idle(self) -> None:
        """Disarm 2 s after a landing, in LAND sooner if it is on the ground already.

        Without a take-off it disarms DISARM_DELAY after it was armed.
        """
        lands, touched_at = self.manoeuvre, self.land_detector.touched_at
        leaves = self.flying or self.land_detector.left_ground
        never_left = isinstance(lands, Land) and not leaves and self.time - lands.begun > _SPOOLED_DOWN
        landed = touched_at is not None and self.time - touched_at > _LANDED_DISARM
        ends = self.manoeuvre.done or self.mode.name in {"LAND", "RTL"}
        delay = self.params["DISARM_DELAY"]
        since = max(self.armed_at, touched_at or 0.0)
        idle = delay > 0 and not self.flying and not self.taking_off and self.time - since > delay
        if (landed and ends) or idle or never_left:
            self.say(INFO, "Disarming motors")
            self.disarm()
