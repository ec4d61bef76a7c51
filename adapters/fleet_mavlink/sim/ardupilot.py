"""ArduCopter 4.6.3 as observed: start-up, arming, GUIDED, fail-safes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot_commands import COMMANDS
from fleet_mavlink.sim.ardupilot_failsafes import ArduPilotFailsafes
from fleet_mavlink.sim.ardupilot_modes import MODES
from fleet_mavlink.sim.autopilot import Autopilot, Boot, CommandHandler
from fleet_mavlink.sim.command_request import FAILED
from fleet_mavlink.sim.fence import is_outside
from fleet_mavlink.sim.manoeuvres import DriveManoeuvre, GoToManoeuvre, Land, Manoeuvre, place_of, resting
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.satellites import ARDUPILOT_LOSS, Loss
from fleet_mavlink.sim.setpoints import ReceivedSetpoint, Triple, setpoint_of, turned
from fleet_mavlink.sim.speaker import CRITICAL, INFO, WARNING
from fleet_mavlink.sim.speeds import ArduPilotSpeeds, FlightSpeeds
from fleet_mavlink.sim.streams import heartbeat

_BODY_FRAMES = frozenset({8, 9})
_OFFSET_FRAMES = frozenset({7, 8, 9})
_RELATIVE_FRAMES = frozenset({3, 6, 10, 11})
_AMSL_FRAMES = frozenset({0, 5})
_STOP = (0.0, 0.0, 0.0)
_LANDED_DISARM = 2.0
_SPOOLED_DOWN = 1.0  # s after which its motors idle in LAND on the ground
_CHECKS_EVERY = 1.0  # s; RUN_PREARM_CHECKS reports its findings without changing the bit
_LOG_REOPENS = 5.0  # s after it could not be opened
_PREARM_EVERY = 30.0
_PREARM_BIT, _GPS_BIT, _RC_BIT = 0x10000000, 0x20, 0x10000


class ArduPilot(Autopilot):
    """ArduCopter."""

    autopilot_id: ClassVar[int] = int(mav.MAV_AUTOPILOT_ARDUPILOTMEGA)
    capabilities: ClassVar[int] = 0xFBEF
    version: ClassVar[int] = 0x040603FF
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    default_rates: ClassVar[Mapping[int, float]] = {mav.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
    real_ready: ClassVar[float] = 42.6
    gps_grace: ClassVar[float] = 8.1
    loss: ClassVar[Loss] = ARDUPILOT_LOSS
    gps_switch: ClassVar[tuple[str, float]] = ("SIM_GPS_DISABLE", 1.0)
    fix_type: ClassVar[int] = 6
    speeds_type: ClassVar[type[FlightSpeeds]] = ArduPilotSpeeds
    spin_up: ClassVar[float] = 3.4
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    first_mode: ClassVar[str] = "STABILIZE"  # until the mode switch of the remote control is read
    switched_mode: ClassVar[str] = "STABILIZE"  # position of that switch
    without_gimbal: ClassVar[int | None] = FAILED
    obeys_other_components: ClassVar[bool] = True
    obeys_broadcast: ClassVar[bool] = True

    def __init__(self, boot: Boot) -> None:
        super().__init__(boot, self.modes[self.first_mode])
        self._switch_read = False
        self._prearm_sent_at = boot.at
        self._checked_at, self._checks_pass = boot.at, False
        self._log_failed_at = -math.inf
        self.failsafes = ArduPilotFailsafes(self)
        self.motors_stopped: Manoeuvre | None = None  # to resume when the emergency stop is released
        self.paused: Manoeuvre | None = None  # manoeuvre to resume after DO_PAUSE_CONTINUE

    # readiness

    @property
    def _gps_found(self) -> bool:
        return self.uptime.reached(10.0)

    @property
    def initialised(self) -> bool:
        """True after "ArduPilot Ready"."""
        return self.uptime.reached(2.45)

    def refusals(self, *, force: bool) -> list[str]:
        """Return why the motors cannot be armed in this mode; ``force`` skips the checks after the start."""
        if not self.initialised:
            return ["System not initialised"]
        if not self.mode.armable or (self.mode.name == "AUTO" and not self.missions.loaded):
            return [f"{self.mode.name} mode not armable"]
        remote_id = self.equipment.remote_id
        unsent = remote_id.refusal(self.time) if remote_id is not None else ""
        found = [f"OpenDroneID: {unsent}"] if unsent else []
        if force:
            return found
        if self.mode.position and not self.has_position:
            found.append("Need Position Estimate")
        if self.outside_fence((self.body.north, self.body.east, self.body.down)):
            found.append("Vehicle outside Polygon fence")
        if self.failsafes.radio_lost:
            found.append("Radio failsafe on")
        if self.time - self._log_failed_at < _LOG_REOPENS:
            found.append("Logging failed")
        if not self.uptime.reached(23.5):
            found.append("EKF3 still initialising")
        return found

    def refusals_to_arm(self, *, force: bool) -> list[str]:
        """Return the reasons against arming now. The log is opened last, and only on arming."""
        found = self.refusals(force=force)
        if found or force or "log_fails" not in self.faults:
            return found
        self._log_failed_at = self.time
        return ["Logging not started"]

    def sensors(self) -> tuple[int, int, int]:
        """Return the observed bits, with the present GPS and PREARM_CHECK."""
        healthy = 0x4770FC0F | (_GPS_BIT if self.gps.fix else 0)
        healthy |= 0 if self.failsafes.radio_lost else _RC_BIT
        if self._checks_pass:
            healthy |= _PREARM_BIT
        return 0x5371FC2F, 0x5361FC2F if self.armed else 0x5261FC2F, healthy

    def system_status(self) -> int:
        """Return MAV_STATE; STANDBY and ACTIVE depend on being landed, not on being armed."""
        if not self.initialised:
            return int(mav.MAV_STATE_BOOT)
        if self.failsafe or self.failsafes.radio_lost:
            return int(mav.MAV_STATE_CRITICAL)
        return int(mav.MAV_STATE_ACTIVE if self.armed and self.flying else mav.MAV_STATE_STANDBY)

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

    # setpoints

    def setpoint(self, message: object) -> None:
        """Follow a setpoint in GUIDED flight; ignore it silently otherwise.

        On the ground it only ends a take-off that has not left it yet.
        """
        if self.mode.name == "GUIDED" and self.armed:
            manoeuvre = self.fly_setpoint(setpoint_of(message))
            if isinstance(manoeuvre, GoToManoeuvre) and self.outside_fence(place_of(manoeuvre)):
                return  # silently
            self.paused = None
            self.manoeuvre = manoeuvre if self.flying else resting(manoeuvre)

    def fly_setpoint(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the manoeuvre; an invalid setpoint stops the vehicle."""
        if setpoint.force or not setpoint.finite:
            return DriveManoeuvre(_STOP)
        heading = setpoint.heading
        if heading is not None and setpoint.frame in _BODY_FRAMES:
            heading += self.body.heading
        if setpoint.position is not None:
            place = self._place(setpoint.frame, setpoint.position)
            if heading is None and setpoint.turn_rate is not None:
                heading = self.body.heading  # a rate of zero keeps the nose
            return GoToManoeuvre(*place, heading=heading) if place is not None else DriveManoeuvre(_STOP)
        known = setpoint.frame in _OFFSET_FRAMES | _RELATIVE_FRAMES | _AMSL_FRAMES | {1}
        if setpoint.velocity is None or not known:
            return DriveManoeuvre(_STOP)
        velocity = setpoint.velocity
        if setpoint.frame in _BODY_FRAMES:
            velocity = turned(velocity, self.body.heading)
        until = self.time + self.params["GUID_TIMEOUT"]
        return DriveManoeuvre(velocity, heading=heading, turn_rate=setpoint.turn_rate, until=until)

    def _place(self, frame: int, position: Triple) -> Triple | None:
        """Return a target as a local position, None for an unsupported frame."""
        x, y, z = position
        if frame == 1:
            return position
        if frame in _OFFSET_FRAMES:
            dn, de, dd = turned(position, self.body.heading) if frame in _BODY_FRAMES else position
            return self.body.north + dn, self.body.east + de, self.body.down + dd
        if frame in _RELATIVE_FRAMES and self.home is not None:
            return self.frame.ned_of(x, y, z + self.home[2])
        return self.frame.ned_of(x, y, z) if frame in _AMSL_FRAMES else None

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
        if self.time - self._checked_at >= _CHECKS_EVERY:
            self._checked_at, self._checks_pass = self.time, not self.refusals(force=False)
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
        if self.home is None and self.uptime.reached(20.0) and self.gps.fix:
            self.send_text_once(INFO, "EKF3 IMU0 origin set")
            self.set_home()
        if self.has_position:
            self.send_text_once(INFO, "EKF3 IMU0 is using GPS")
        elif not self.armed and self.time - self._prearm_sent_at > _PREARM_EVERY:
            self._prearm_sent_at = self.time
            for refusal in self.refusals(force=False):
                self.say(CRITICAL, f"PreArm: {refusal}")

    def watch_idle(self) -> None:
        """Disarm 2 s after a landing, in LAND sooner if it is on the ground already.

        Without a take-off it disarms DISARM_DELAY after it was armed.
        """
        lands, leaves = self.manoeuvre, self.flying or self.left_ground
        never_left = isinstance(lands, Land) and not leaves and self.time - lands.begun > _SPOOLED_DOWN
        landed = self.touched_at is not None and self.time - self.touched_at > _LANDED_DISARM
        ends = self.manoeuvre.done or self.mode.name in {"LAND", "RTL"}
        delay = self.params["DISARM_DELAY"]
        since = max(self.armed_at, self.touched_at or 0.0)
        idle = delay > 0 and not self.flying and not self.taking_off and self.time - since > delay
        if (landed and ends) or idle or never_left:
            self.say(INFO, "Disarming motors")
            self.disarm()

    def outside_fence(self, place: Triple) -> bool:
        """Return True beyond the fence, if FENCE_ENABLE is set, by the bounds in FENCE_TYPE."""
        params = self.params
        return bool(params["FENCE_ENABLE"]) and is_outside(
            self,
            place,
            kinds=int(params["FENCE_TYPE"]),
            height=params["FENCE_ALT_MAX"],
            radius=params["FENCE_RADIUS"],
        )
