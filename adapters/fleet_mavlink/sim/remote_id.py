"""Remote ID of a simulated ArduCopter 4.6.3 (AP_OpenDroneID) and of its transmitter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mav

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_MAX_AGE = 3.0  # s: largest age of the data for the arming checks
_OTHERS_AGE = 22.0  # s: of the other data for the transmitter
_LOST_AFTER = 5.0  # s, and between texts about it
_WARNING, _INFO = 4, 6  # severities
_ERROR = 49  # characters
_NAMES = ("BASIC_ID", "OPERATOR_ID", "SELF_ID", "SYSTEM", "SYSTEM_UPDATE")
MESSAGES = tuple(f"OPEN_DRONE_ID_{name}" for name in _NAMES)


class SimRemoteId:
    """Messages received by the autopilot, and when; times are seconds of the simulation, None: never."""

    def __init__(self) -> None:
        self.system: Any = None
        self.heard: dict[str, float] = {}
        self.arm_status: Any = None
        self.arm_status_at: float | None = None
        self._lost_transmitter_at: float | None = None
        self._lost_operator_at: float | None = None

    def handle_message(self, message: Any, now: float) -> None:
        """Process a message of a station."""
        name = message.get_type().removeprefix("OPEN_DRONE_ID_")
        if name == "BASIC_ID" and message.id_type == mav.MAV_ODID_ID_TYPE_NONE:
            return
        if name == "SYSTEM":
            self.system = message
        elif name == "SYSTEM_UPDATE" and self.system is not None:
            self.system.operator_latitude = message.operator_latitude
            self.system.operator_longitude = message.operator_longitude
            self.heard["SYSTEM"] = now  # counts only after a complete SYSTEM
        self.heard[name] = now

    def handle_arm_status(self, message: Any, now: float) -> None:
        """Process the transmitter's arm status, which is received on its own port only."""
        self.arm_status, self.arm_status_at = message, now

    def refusal(self, now: float) -> str:
        """Return why the motors cannot be armed, empty if they can; force does not skip this."""
        if "BASIC_ID" not in self.heard:
            return "UA_TYPE required in BasicID"
        if self._no_place():
            return "operator location must be set"
        if self.arm_status_at is None or now - self.arm_status_at > _MAX_AGE:
            return "ARM_STATUS not available"
        if now - self.heard["SYSTEM"] > _MAX_AGE:
            return "SYSTEM not available"
        if self.arm_status.status != mav.MAV_ODID_ARM_STATUS_GOOD_TO_ARM:
            return str(self.arm_status.error)
        return ""

    def _no_place(self) -> bool:
        """Return True if the operator's position is unknown."""
        system = self.system
        return system is None or (system.operator_latitude == 0 and system.operator_longitude == 0)

    def say(self, pilot: Autopilot) -> None:
        """Send texts about losses, and returns."""
        now = pilot.time
        if now - (self.arm_status_at or 0.0) > _LOST_AFTER:
            if now - (self._lost_transmitter_at or 0.0) > _LOST_AFTER:
                self._lost_transmitter_at = now
                pilot.say(_WARNING, "ODID: lost transmitter")
        elif self._lost_transmitter_at is not None:
            self._lost_transmitter_at = None
            pilot.say(_INFO, "ODID: transmitter OK")
        lost = now - self.heard.get("SYSTEM", 0.0) > _LOST_AFTER
        if lost and now - (self._lost_operator_at or 0.0) > _LOST_AFTER:
            self._lost_operator_at = now
            pilot.say(_WARNING, "ODID: lost operator location")

    def missing_data(self, now: float, *, located: bool) -> str:
        """Return the data that the transmitter misses, in its own words; empty without any."""
        ages = (("SELF_ID", "SELF_ID", _OTHERS_AGE), ("OPERATOR_ID", "OP_ID", _OTHERS_AGE))
        missing = [] if located else ["LOC"]
        missing += [] if "BASIC_ID" in self.heard else ["ID"]
        missing += [word for name, word, age in ages if now - self.heard.get(name, -age) >= age]
        missing += ["SYS"] if now - self.heard.get("SYSTEM", -_MAX_AGE) >= _MAX_AGE else []
        words = f"missing {' '.join(missing)}" if missing else ""
        if self._no_place():
            words = f"{words} zero OP_LOC".strip()
        return words[:_ERROR]
