"""PX4 1.16.1 as observed: modes, texts, motors, battery."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import Autopilot, Boot, CommandHandler
from fleet_mavlink.sim.command_request import ACCEPTED, TEMPORARILY_REJECTED, CommandRequest
from fleet_mavlink.sim.fence import CIRCLE, HEIGHT, POLYGON, FenceBounds
from fleet_mavlink.sim.message_output import CRITICAL, INFO
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.params import Params
from fleet_mavlink.sim.parts import Parts
from fleet_mavlink.sim.px4_arming import Px4Arming
from fleet_mavlink.sim.px4_commands import COMMANDS
from fleet_mavlink.sim.px4_failsafes import Px4Failsafes
from fleet_mavlink.sim.px4_modes import MODES, MODES_BY_NUMBER
from fleet_mavlink.sim.px4_offboard import Px4Offboard
from fleet_mavlink.sim.px4_status import Px4Status
from fleet_mavlink.sim.px4_takeoff import Px4LandDetector, Px4TakeoffControl, wander
from fleet_mavlink.sim.satellites import PX4_GPS, GpsProfile
from fleet_mavlink.sim.speeds import Px4Speeds

_GCS_GONE = 3.0
_PREFLIGHT = 1.1  # s on top of COM_DISARM_PRFLT
_TEXTS_KEPT = 20
_UNSET_PERCENT = 50.0  # SIM_BAT_MIN_PCT as it is delivered
_HAS_RECEIVER = frozenset({0, 2, 3})  # COM_RC_IN_MODE; the simulated one's own, 1, is without
_NOT_CHOSEN = frozenset({"TAKEOFF", "LAND", "PRECLAND", "RTL"})


def _fence(params: Params) -> FenceBounds | None:
    """Return the bounds; none with GF_ACTION 0."""
    if not params["GF_ACTION"]:
        return None
    return FenceBounds(HEIGHT | CIRCLE | POLYGON, params["GF_MAX_VER_DIST"], params["GF_MAX_HOR_DIST"])


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
    starts_in: ClassVar[float] = 4.0  # until the heartbeat says STANDBY
    gps_profile: ClassVar[GpsProfile] = PX4_GPS
    parts: ClassVar[Parts] = Parts(
        speeds=Px4Speeds,
        fence=_fence,
        arming=Px4Arming,
        status=Px4Status,
        setpoints=Px4Offboard,
        failsafes=Px4Failsafes,
        land_detector=Px4LandDetector,
    )
    takeoff_control: ClassVar[type[Px4TakeoffControl]] = Px4TakeoffControl
    spin_up: ClassVar[float] = 4.2
    modes: ClassVar[Mapping[str, FlightMode]] = MODES
    without_gimbal: ClassVar[int | None] = None
    ends_text: ClassVar[str] = "\t"
    text_id_always: ClassVar[bool] = True
    ack_delay: ClassVar[float] = 0.0038
    ack_queue: ClassVar[int] = 4
    setpoints: Px4Offboard
    failsafes: Px4Failsafes

    def __init__(self, boot: Boot) -> None:
        super().__init__(boot, MODES["LOITER"])
        self.chosen: FlightMode = self.mode  # it returns to it after a landing
        self.takeoff = self.takeoff_control(self)
        self._withheld: list[object] = []

    # readiness

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
        if mode.name == "OFFBOARD" and not self.setpoints.alive:
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

    def arm(self) -> None:
        """Start the motors and the manoeuvre of the current mode."""
        super().arm()
        self.enter(self.mode)
        if self.mode.name == "TAKEOFF":
            self.takeoff.begin()

    def disarm(self) -> None:
        """Stop the motors, and return to the mode that was chosen last."""
        super().disarm()
        self.failsafes.over()
        if not self.terminated:
            self.enter(self.chosen)

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
        if self.land_detector.landed:
            self.frame.altitude_error = wander(self.faults.get("wander", 0.0), self.time)
        if self.armed:
            self._end_manoeuvre()
            self._auto_disarm()
        elif self.uptime.reached(2.0) and (not self.home.known or self.flying):
            self.home.set_here()
        self.failsafes.watch()

    def _end_manoeuvre(self) -> None:
        """Change from TAKEOFF to LOITER, and from a finished mission to LOITER or RTL."""
        self.takeoff.watch()
        if self.runs_mission and getattr(self.manoeuvre, "returns", False):
            self.enter(MODES["RTL"])
        elif self.runs_mission and self.manoeuvre.done and self.flying:
            self.enter(MODES["LOITER"])

    def _auto_disarm(self) -> None:
        """Disarm after a landing, or when no take-off follows the arming."""
        if not self.land_detector.landed or self.terminated:
            return
        touched_at = self.land_detector.touched_at
        if touched_at is not None:
            if self.time - touched_at > self.params["COM_DISARM_LAND"] > 0:
                self.say(INFO, "Disarmed by landing")
                self.disarm()
        elif (
            not self.taking_off
            and self.time - self.armed_at - _PREFLIGHT > self.params["COM_DISARM_PRFLT"] > 0
        ):
            self.say(INFO, "Disarmed by auto preflight disarming")
            self.disarm()
