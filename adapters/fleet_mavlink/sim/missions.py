"""Mission protocol: the stored plans, their download and removal, and the progress of the mission.

The autopilots differ in whether item 0 is home (ArduPilot), and in how often they report a reached item.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.mission_items import MISSION, Item, MissionBehaviour
from fleet_mavlink.sim.mission_upload import MissionUpload

NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5  # MISSION_STATE
_REPEATED_AFTER = 1.0  # s


class SimMissions:
    """Stored plans of one vehicle, by MAV_MISSION_TYPE (they survive a reboot)."""

    def __init__(self, behaviour: MissionBehaviour) -> None:
        self.behaviour = behaviour
        self._plans: dict[int, list[Item]] = {}
        self.upload = MissionUpload(behaviour, self._store)
        self.current = 0
        self.state = NO_MISSION
        self._reached: tuple[int, int, float] | None = None  # item, remaining reports, time of the next

    def reached(self, now: float) -> object:
        """Return the message that the current item is reached; PX4 repeats it."""
        self._reached = (self.current, self.behaviour.reached_times - 1, now + _REPEATED_AFTER)
        return mav.MAVLink_mission_item_reached_message(self.current)

    def _repeated_reports(self, now: float) -> Iterable[object]:
        """Repeat the report of the last reached item, even after another mission was uploaded."""
        if self._reached is None or not self._reached[1] or now < self._reached[2]:
            return ()
        item, times, _ = self._reached
        self._reached = (item, times - 1, now + _REPEATED_AFTER)
        return [mav.MAVLink_mission_item_reached_message(item)]

    def plan(self, kind: int) -> list[Item]:
        """Return the stored items of a MAV_MISSION_TYPE."""
        return self._plans.get(kind, [])

    @property
    def items(self) -> list[Item]:
        """The mission itself."""
        return self.plan(MISSION)

    @property
    def first(self) -> int:
        """Number of the first item that is flown."""
        return 1 if self.behaviour.home_is_first else 0

    @property
    def total(self) -> int:
        """Number in MISSION_CURRENT: ArduPilot leaves home out."""
        return max(0, len(self.items) - self.first)

    @property
    def loaded(self) -> bool:
        """True if there is something to fly."""
        return self.total > 0

    def reboot(self) -> None:
        """Drop the transfer and restart the mission."""
        self.upload.reboot()
        self._reached = None
        self._rewind()

    def disarmed(self) -> None:
        """Restart the mission, if its current item was kept."""
        if self.behaviour.keeps_place and self.state in {ACTIVE, PAUSED}:
            self._rewind()

    def _rewind(self) -> None:
        self.current = 0
        self.state = NOT_STARTED if self.loaded else NO_MISSION

    def overdue(self, now: float) -> Iterable[object]:
        """Repeat due reports; request an overdue item, end a silent upload."""
        return [*self._repeated_reports(now), *self.upload.overdue(now)]

    def _store(self, kind: int, items: list[Item]) -> None:
        """Replace a plan by an uploaded one."""
        self._plans[kind] = items
        in_progress = self.state in {ACTIVE, PAUSED} and self.current < len(self.items)
        if kind == MISSION and not (self.behaviour.keeps_place and in_progress):
            self._rewind()

    def request_list(self, message: Any) -> Iterable[object]:
        """Answer MISSION_REQUEST_LIST with the number of items."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        kind = message.mission_type
        if self.upload.is_under_way:
            return [mav.MAVLink_mission_ack_message(system, component, mav.MAV_MISSION_DENIED, kind)]
        count = len(self.plan(kind))
        return [mav.MAVLink_mission_count_message(system, component, count, kind)]

    def request(self, message: Any, home: tuple[float, float, float] | None) -> Iterable[object]:
        """Answer MISSION_REQUEST_INT or MISSION_REQUEST with the item."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        kind, seq = message.mission_type, message.seq
        plan = self.plan(kind)
        if seq >= len(plan):
            failed = mav.MAV_MISSION_INVALID_SEQUENCE
            return [mav.MAVLink_mission_ack_message(system, component, failed, kind)]
        item = plan[seq]
        if seq == 0 and self.behaviour.home_is_first and kind == MISSION and home is not None:
            item = Item(0, 16, 1, 0.0, 0.0, 0.0, 0.0, int(home[0] * 1e7), int(home[1] * 1e7), home[2])
        now_flown = int(kind == MISSION and seq == self.current)
        frame = self.behaviour.frames_reported.get(item.frame, item.frame)
        numbers = (seq, frame, item.command, now_flown, item.autocontinue)
        params = (item.p1, item.p2, item.p3, item.p4)
        if message.get_type() == "MISSION_REQUEST":
            place = (item.x / 1e7, item.y / 1e7, item.z)
            return [mav.MAVLink_mission_item_message(system, component, *numbers, *params, *place, kind)]
        place = (item.x, item.y, item.z)
        return [mav.MAVLink_mission_item_int_message(system, component, *numbers, *params, *place, kind)]

    def clear(self, message: Any) -> Iterable[Any]:
        """Delete a plan, or all of them (MISSION_CLEAR_ALL); ArduPilot refuses while it flies it."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        result = mav.MAV_MISSION_ACCEPTED
        if self.state == ACTIVE and self.behaviour.home_is_first:
            result = mav.MAV_MISSION_ERROR
        elif message.mission_type == mav.MAV_MISSION_TYPE_ALL:
            self._plans.clear()
            self._rewind()
        else:
            self._plans.pop(message.mission_type, None)
            self._rewind()
        return [mav.MAVLink_mission_ack_message(system, component, result, message.mission_type)]

    def set_current(self, seq: int) -> bool:
        """Continue with another item; False if there is no such item."""
        if not 0 <= seq < len(self.items):
            return False
        self.current = max(seq, self.first)
        if self.state == COMPLETE:
            self.state = NOT_STARTED
        return True
