"""PX4 1.16.1 as observed: start-up, arming, OFFBOARD, fail-safes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import Autopilot, Boot, CommandHandler
from fleet_mavlink.sim.command_request import ACCEPTED, TEMPORARILY_REJECTED, CommandRequest, ack
from fleet_mavlink.sim.fence import CIRCLE, HEIGHT, POLYGON, is_outside
from fleet_mavlink.sim.manoeuvres import DriveManoeuvre, GoToManoeuvre, Manoeuvre
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.px4_commands import COMMANDS
from fleet_mavlink.sim.px4_failsafes import Px4Failsafes
from fleet_mavlink.sim.px4_modes import MODES, MODES_BY_NUMBER
from fleet_mavlink.sim.px4_takeoff import Px4Takeoff, wander, watch
from fleet_mavlink.sim.satellites import PX4_LOSS, Loss
from fleet_mavlink.sim.setpoints import ReceivedSetpoint, Triple, setpoint_of, turned
from fleet_mavlink.sim.speaker import CRITICAL, INFO
from fleet_mavlink.sim.speeds import FlightSpeeds, Px4Speeds

_BODY_NED = 8
_LOCAL_NED = 1
_RELATIVE_FRAMES = frozenset({3, 6})
_AMSL_FRAMES = frozenset({0, 5})
_BACK_TO_OFFBOARD = 0.3
_COMMANDER = 0.008  # seconds after the MAVLink module at which the commander answers
_GCS_GONE = 3.0
_PREFLIGHT = 1.1  # s on top of COM_DISARM_PRFLT
_TEXTS_KEPT = 20
_UNSET_PERCENT = 50.0  # SIM_BAT_MIN_PCT as it is delivered
_PREARM_BIT, _GPS_BIT, _RC_BIT = 0x10000000, 0x20, 0x10000
_HAS_RECEIVER = frozenset({0, 2, 3})  # COM_RC_IN_MODE; the simulated one's own, 1, is without
_NOT_CHOSEN = frozenset({"TAKEOFF", "LAND", "PRECLAND", "RTL"})


class SimPx4(Autopilot):
    """PX4 multicopter."""

    autopilot_id: ClassVar[int] = int(mav.MAV_AUTOPILOT_PX4)
    capabilities: ClassVar[int] = 0xE8FF
    version: ClassVar[int] = 0x011001FF
    commands: ClassVar[Mapping[int, CommandHandler]] = COMMANDS
    default_rates: ClassVar[Mapping[int, float]] = {
        mav.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        mav.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
        mav.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        mav.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
        mav.MAVLINK_MSG_ID_ATTITUDE: 50.0,
        mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
        mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
        mav.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        mav.MAVLINK_MSG_ID_VFR_HUD: 4.0,
        mav.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        mav.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
        mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    }
    real_ready: ClassVar[float] = 4.6
    gps_grace: ClassVar[float] = 5.1
    loss: ClassVar[Loss] = PX4_LOSS
    gps_switch: ClassVar[tuple[str, float]] = ("SIM_GPS_USED", 0.0)
    fix_type: ClassVar[int] = 3
    speeds_type: ClassVar[type[FlightSpeeds]] = Px4Speeds
    spin_up: ClassVar[float] = 4.2
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    without_gimbal: ClassVar[int | None] = None
    ends_text: ClassVar[str] = "\t"
    text_id_always: ClassVar[bool] = True
    ack_delay: ClassVar[float] = 0.0038
    ack_queue: ClassVar[int] = 4

    def __init__(self, boot: Boot) -> None:
        super().__init__(boot, MODES["LOITER"])
        self.chosen: FlightMode = self.mode  # it returns to it after a landing
        self.takeoff: Manoeuvre | None = None  # requested by the take-off command
        self._setpoint_at: float | None = None
        self._stream_since = 0.0
        self.failsafes = Px4Failsafes(self)
        self._withheld: list[object] = []

    # readiness

    @property
    def _gps_found(self) -> bool:
        return True

    @property
    def initialised(self) -> bool:
        """True once the heartbeat says STANDBY."""
        return self.uptime.reached(4.0)

    @property
    def has_receiver(self) -> bool:
        """True if COM_RC_IN_MODE expects a receiver."""
        return int(self.params["COM_RC_IN_MODE"]) in _HAS_RECEIVER

    @property
    def remote_control(self) -> bool:
        """True while a receiver gets the remote control's signal."""
        return self.has_receiver and super().remote_control

    @property
    def gcs_lost(self) -> bool:
        """True when the last message of a ground station is too old, or there was none."""
        return self.gcs_heard_at is None or self.time - self.gcs_heard_at > _GCS_GONE

    def refusals(self, *, force: bool) -> list[str]:
        """Return why the motors cannot be armed; force skips all checks but those of the start."""
        if not self.uptime.reached(self.real_ready) or "not_ready" in self.faults or self.terminated:
            return ["Resolve system health failures first"]
        if force:
            return []
        found = []
        if not self.has_position or self.refusal_of(self.mode) or not self.mode.armable:
            found.append("Resolve system health failures first")
        if self.params["NAV_DLL_ACT"] > 0 and self.gcs_lost:
            found.append("No connection to the ground control station")
        return found

    def sensors(self) -> tuple[int, int, int]:
        """Return the observed bits, with those of GPS and PREARM_CHECK as they are now."""
        if not self.uptime.reached(3.0):
            return 0, 0, 0x321C83F & ~_GPS_BIT
        healthy = 0x320C81F | (_GPS_BIT if self.gps.fix else 0)
        if not self.refusals(force=False):
            healthy |= _PREARM_BIT
        receiver = _RC_BIT if self.has_receiver else 0
        healthy |= _RC_BIT if self.remote_control else 0
        return 0x300402F | receiver, 0x301402F, healthy

    def system_status(self) -> int:
        """Return MAV_STATE; STANDBY or ACTIVE depends on the motors being armed."""
        if self.terminated:
            return int(mav.MAV_STATE_FLIGHT_TERMINATION)
        if not self.initialised:
            return int(mav.MAV_STATE_UNINIT)
        if self.failsafe:
            return int(mav.MAV_STATE_CRITICAL)
        return int(mav.MAV_STATE_ACTIVE if self.armed else mav.MAV_STATE_STANDBY)

    # texts

    def say(self, severity: int, text: str) -> None:
        """Send a text, or keep it until a ground station sends."""
        before = len(self.out)
        super().say(severity, text)
        if self.gcs_lost:
            self._withheld.extend(self.out[before:])
            del self.out[before:]
            del self._withheld[:-_TEXTS_KEPT]

    def gcs_heartbeat(self, message: object) -> None:
        """Note any ground station; withheld texts follow 50 ms apart."""
        super().gcs_heartbeat(message)
        for place, text in enumerate(self._withheld):
            self.later(0.05 * (place + 1), text)
        self._withheld.clear()
        self.failsafes.over("gcs")

    # modes

    def refusal_of(self, mode: FlightMode) -> str:
        """Return why a mode cannot run now, empty when it can."""
        if mode.name == "OFFBOARD" and not self.stream_alive:
            return "Switching to Offboard is currently not available"
        if mode.name == "MISSION" and not self.missions.loaded:
            return "Mission mode is not available: no valid mission"
        if mode.position and not self.has_position:
            return f"Switching to {mode.name.title()} is currently not available"
        manual = mode.name in {"MANUAL", "ALTCTL", "POSCTL", "STABILIZED"}
        return f"Switching to {mode.name.title()} is not possible: no manual control" if manual else ""

    def change_mode(self, mode: FlightMode) -> int:
        """Enter the mode that a user requests; any mode while disarmed. Returns MAV_RESULT."""
        if self.terminated:
            return TEMPORARILY_REJECTED
        refusal = self.refusal_of(mode) if self.armed else ""
        if refusal:
            self.say(CRITICAL, refusal)
            return TEMPORARILY_REJECTED
        self.failsafes.over()
        if mode.name not in _NOT_CHOSEN:
            self.chosen = mode
        self.enter(mode)
        return ACCEPTED

    def set_mode(self, message: Any) -> None:
        """Obey SET_MODE; it is acknowledged as DO_SET_MODE."""
        requester = message.get_srcSystem(), message.get_srcComponent()
        nan = float("nan")
        request = CommandRequest(mav.MAV_CMD_DO_SET_MODE, 1.0, 0.0, 0.0, nan, nan, nan, nan, None, *requester)
        mode = MODES_BY_NUMBER.get(message.custom_mode)
        self.acknowledge(request, self.change_mode(mode) if mode else ACCEPTED)

    def acknowledge_again(self, request: CommandRequest, result: int) -> None:
        """Send the commander's answer after that of the MAVLink module."""
        if "no_ack" not in self.faults:
            self.later(self.ack_delay + _COMMANDER, ack(request, result))

    def take_off(self, manoeuvre: Manoeuvre) -> None:
        """Start a take-off now, or once the motors are armed."""
        self.failsafes.over()
        self.takeoff = manoeuvre
        self.enter(MODES["TAKEOFF"])
        if self.armed:
            self.begin_takeoff()

    def begin_takeoff(self) -> None:
        """Start the requested take-off; its delay counts from now."""
        requested, self.takeoff = self.takeoff, None
        if requested is not None:
            self.manoeuvre = (
                Px4Takeoff(self, requested.altitude) if isinstance(requested, Px4Takeoff) else requested
            )

    def takeoff_detected(self) -> None:
        """Send the text, and set home again."""
        self.say(INFO, "Takeoff detected")
        self.set_home()

    def takeoff_ended(self, hold: GoToManoeuvre) -> None:
        """Change to LOITER, which climbs on to the requested height."""
        self.enter(MODES["LOITER"])
        self.manoeuvre = hold

    @property
    def landed(self) -> bool:
        """True on the ground until a take-off is detected."""
        taking_off = isinstance(self.manoeuvre, Px4Takeoff) and self.manoeuvre.detected
        return self.body.grounded and not taking_off

    def arm(self) -> None:
        """Start the motors and the manoeuvre of the current mode."""
        super().arm()
        self.enter(self.mode)
        if self.mode.name == "TAKEOFF":
            self.begin_takeoff()

    def disarm(self) -> None:
        """Stop the motors, and return to the mode that was chosen last."""
        super().disarm()
        self.failsafes.over()
        if not self.terminated:
            self.enter(self.chosen)

    # setpoints

    @property
    def stream_alive(self) -> bool:
        """True while the last setpoint is younger than COM_OF_LOSS_T."""
        return self._setpoint_at is not None and self.time - self._setpoint_at <= self.params["COM_OF_LOSS_T"]

    def setpoint(self, message: Any) -> None:
        """Take a setpoint: it keeps the stream alive, and is obeyed in OFFBOARD."""
        setpoint = setpoint_of(message)
        if setpoint.heading is not None and math.isnan(setpoint.heading):
            setpoint = replace(setpoint, heading=None)
        refusal = _refusal(setpoint, local=message.get_type() == "SET_POSITION_TARGET_LOCAL_NED")
        if refusal:
            self.say(CRITICAL, refusal)
            return
        if not self.stream_alive:
            self._stream_since = self.time
        self._setpoint_at = self.time
        back = self.time - self._stream_since >= _BACK_TO_OFFBOARD
        if back and self.failsafes.over("offboard"):
            self.enter(MODES["OFFBOARD"])
        if self.armed and self.mode.name == "OFFBOARD":
            self.manoeuvre = self.fly_setpoint(setpoint)

    def fly_setpoint(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the manoeuvre; the heading is kept when the message leaves it out."""
        heading = setpoint.heading
        if heading is None and setpoint.turn_rate is None:
            heading = self.body.heading
        if setpoint.position is not None and setpoint.frame != _BODY_NED:
            place = self._place(setpoint.frame, setpoint.position)
            return GoToManoeuvre(*place, heading=self.body.heading if heading is None else heading)
        velocity = setpoint.velocity or (0.0, 0.0, 0.0)
        if setpoint.frame == _BODY_NED:
            velocity = turned(velocity, self.body.heading)
        return DriveManoeuvre(velocity, heading=heading, turn_rate=setpoint.turn_rate)

    def _place(self, frame: int, position: Triple) -> Triple:
        """Return a target as a local position."""
        if frame == _LOCAL_NED:
            return position
        x, y, z = position
        base = self.home[2] if frame in _RELATIVE_FRAMES and self.home is not None else 0.0
        return self.frame.ned_of(x, y, z + base)

    # without commands

    def drain(self, dt: float) -> None:
        """Drain the battery; where SIM_BAT_MIN_PCT is set, down to that, all of it in SIM_BAT_DRAIN s."""
        before, lowest = self.battery.percent, self.params["SIM_BAT_MIN_PCT"]
        super().drain(dt)
        if self.armed and lowest < _UNSET_PERCENT:
            drained = before - 100.0 * dt / max(self.params["SIM_BAT_DRAIN"], 0.1)
            self.battery.percent = max(min(lowest, before), drained)

    def supervise(self) -> None:
        """Set home, end manoeuvres, disarm, watch the fail-safes."""
        if self.landed:
            self.frame.altitude_error = wander(self.faults.get("wander", 0.0), self.time)
        if self.armed:
            self._end_manoeuvre()
            self._auto_disarm()
        elif self.uptime.reached(2.0) and (self.home is None or self.flying):
            self.set_home()
        self.failsafes.watch()

    def _end_manoeuvre(self) -> None:
        """Change from TAKEOFF to LOITER, and from a finished mission to LOITER or RTL."""
        watch(self)
        if self.runs_mission and getattr(self.manoeuvre, "returns", False):
            self.enter(MODES["RTL"])
        elif self.runs_mission and self.manoeuvre.done and self.flying:
            self.enter(MODES["LOITER"])

    def touched_ground(self) -> None:
        """Send the text of a landing."""
        self.say(INFO, "Landing detected")

    def _auto_disarm(self) -> None:
        """Disarm after a landing, or when no take-off follows the arming."""
        if not self.landed or self.terminated:
            return
        if self.touched_at is not None:
            if self.time - self.touched_at > self.params["COM_DISARM_LAND"] > 0:
                self.say(INFO, "Disarmed by landing")
                self.disarm()
        elif (
            not self.taking_off
            and self.time - self.armed_at - _PREFLIGHT > self.params["COM_DISARM_PRFLT"] > 0
        ):
            self.say(INFO, "Disarmed by auto preflight disarming")
            self.disarm()

    def outside_fence(self, place: Triple) -> bool:
        """Return whether a place is outside the fence; never with GF_ACTION 0."""
        params = self.params
        return bool(params["GF_ACTION"]) and is_outside(
            self,
            place,
            kinds=HEIGHT | CIRCLE | POLYGON,
            height=params["GF_MAX_VER_DIST"],
            radius=params["GF_MAX_HOR_DIST"],
        )


def _refusal(setpoint: ReceivedSetpoint, *, local: bool) -> str:
    """Return why a setpoint is not taken, empty when it is."""
    frames = {_LOCAL_NED, _BODY_NED} if local else _RELATIVE_FRAMES | _AMSL_FRAMES
    if setpoint.frame not in frames:
        return f"SET_POSITION_TARGET: coordinate frame {setpoint.frame} unsupported"
    wanted = setpoint.velocity if setpoint.frame == _BODY_NED else setpoint.velocity or setpoint.position
    if wanted is None or not setpoint.finite or setpoint.force:
        return "SET_POSITION_TARGET: invalid"
    return ""
