"""The mission protocol: upload, download, clear, and where the mission stands.

The autopilots differ in how they ask for an item and how often they repeat it, in whether item 0 is
home (ArduPilot), and in how they take a repeated item.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mav

NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5  # MISSION_STATE
FENCE = int(mav.MAV_MISSION_TYPE_FENCE)
_MISSION = int(mav.MAV_MISSION_TYPE_MISSION)
_TOLD_AGAIN = 1.0  # s
_GIVE_UP = 8.0  # seconds without an item that end an upload
_FIRST_DO = 80  # commands from here on are not navigation
_FLOWN = frozenset({16, 17, 19, 20, 21, 22, 31, 82, 93})  # navigation that both fly
LOITER_TURNS = 18  # PX4 has no such item
_COUNT_MAX = 700


class Item(NamedTuple):
    """One mission item; x and y are degrees times 1e7."""

    frame: int
    command: int
    autocontinue: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: int
    y: int
    z: float


@dataclass(frozen=True, slots=True)
class Habits:
    """How one autopilot speaks the protocol."""

    request: Callable[[int, int, int, int], Any]
    repeat: float  # seconds after which a request is repeated
    home_is_first: bool
    tells_duplicates: bool
    keeps_place: bool  # a mission that replaces a begun one goes on at its current number
    frames_told: Mapping[int, int]  # frames that come back as another one
    reached_times: int = 1  # that the end of an item is told, a second apart
    flies: frozenset[int] = _FLOWN


ARDUPILOT_HABITS = Habits(
    mav.MAVLink_mission_request_message,
    1.0,
    home_is_first=True,
    tells_duplicates=True,
    keeps_place=True,
    frames_told={5: 0, 6: 3},
    flies=_FLOWN | {LOITER_TURNS},
)
PX4_HABITS = Habits(
    mav.MAVLink_mission_request_int_message,
    0.25,
    home_is_first=False,
    tells_duplicates=False,
    keeps_place=False,
    frames_told={},
    reached_times=11,
)


@dataclass(slots=True)
class _Upload:
    """An upload that is under way."""

    system: int
    component: int
    kind: int
    count: int
    items: list[Item]
    asked_at: float
    heard_at: float


class SimMissions:
    """The stored plans of one vehicle (they survive a reboot) by MAV_MISSION_TYPE, and their transfer."""

    def __init__(self, habits: Habits) -> None:
        self.habits = habits
        self._plans: dict[int, list[Item]] = {}
        self._upload: _Upload | None = None
        self.current = 0
        self.state = NO_MISSION
        self._reached: tuple[int, int, float] | None = None  # the item, how often it is told still, when next

    def reached(self, now: float) -> object:
        """Return the message that the current item is done; PX4 tells it again and again."""
        self._reached = (self.current, self.habits.reached_times - 1, now + _TOLD_AGAIN)
        return mav.MAVLink_mission_item_reached_message(self.current)

    def _told_again(self, now: float) -> Iterable[object]:
        """Tell the last item that was done again, also where another mission has come since."""
        if self._reached is None or not self._reached[1] or now < self._reached[2]:
            return ()
        item, times, _ = self._reached
        self._reached = (item, times - 1, now + _TOLD_AGAIN)
        return [mav.MAVLink_mission_item_reached_message(item)]

    def plan(self, kind: int) -> list[Item]:
        """Return the stored items of a MAV_MISSION_TYPE."""
        return self._plans.get(kind, [])

    @property
    def items(self) -> list[Item]:
        """The mission itself."""
        return self.plan(_MISSION)

    @property
    def first(self) -> int:
        """Number of the first item that is flown."""
        return 1 if self.habits.home_is_first else 0

    @property
    def total(self) -> int:
        """Number that MISSION_CURRENT tells: ArduPilot leaves home out."""
        return max(0, len(self.items) - self.first)

    @property
    def loaded(self) -> bool:
        """True when there is something to fly."""
        return self.total > 0

    def reboot(self) -> None:
        """Forget the transfer and start the mission anew."""
        self._upload = None
        self._reached = None
        self._rewind()

    def disarmed(self) -> None:
        """Forget, where it was kept, at which item the mission was left."""
        if self.habits.keeps_place and self.state in {ACTIVE, PAUSED}:
            self._rewind()

    def _rewind(self) -> None:
        self.current = 0
        self.state = NOT_STARTED if self.loaded else NO_MISSION

    def overdue(self, now: float) -> Iterable[object]:
        """Say what is to be said again; ask for an item that did not come, end an upload that went silent."""
        return [*self._told_again(now), *self._asked_again(now)]

    def _asked_again(self, now: float) -> Iterable[object]:
        """Go on with an upload."""
        upload = self._upload
        if upload is None:
            return ()
        if now - upload.heard_at > _GIVE_UP:
            self._upload = None
            return [self._ack(upload, mav.MAV_MISSION_OPERATION_CANCELLED)]
        if now - upload.asked_at < self.habits.repeat:
            return ()
        upload.asked_at = now
        return [self._request(upload)]

    def count(self, message: Any, now: float) -> Iterable[object]:
        """Begin an upload (MISSION_COUNT)."""
        upload = _Upload(
            message.get_srcSystem(),
            message.get_srcComponent(),
            message.mission_type,
            message.count,
            [],
            now,
            now,
        )
        if message.count > _COUNT_MAX:
            return [self._ack(upload, mav.MAV_MISSION_NO_SPACE)]
        if message.count == 0:
            return self._store(upload)
        self._upload = upload
        return [self._request(upload)]

    def item(self, message: Any, now: float) -> Iterable[object]:
        """Take an item of the upload (MISSION_ITEM_INT or MISSION_ITEM)."""
        upload = self._upload
        if upload is None or message.mission_type != upload.kind:
            return ()
        upload.heard_at = now
        if message.seq != len(upload.items):
            told = self.habits.tells_duplicates
            return [self._ack(upload, mav.MAV_MISSION_INVALID_SEQUENCE)] if told else ()
        item = _item_of(message)
        if upload.kind == _MISSION and item.command < _FIRST_DO and item.command not in self.habits.flies:
            self._upload = None
            return [self._ack(upload, mav.MAV_MISSION_UNSUPPORTED)]
        upload.items.append(item)
        if len(upload.items) == upload.count:
            return self._store(upload)
        upload.asked_at = now
        return [self._request(upload)]

    def _store(self, upload: _Upload) -> Iterable[object]:
        """End an upload: the plan replaces the old one."""
        self._upload = None
        self._plans[upload.kind] = upload.items
        begun = self.state in {ACTIVE, PAUSED} and self.current < len(self.items)
        if upload.kind == _MISSION and not (self.habits.keeps_place and begun):
            self._rewind()
        return [self._ack(upload, mav.MAV_MISSION_ACCEPTED)]

    def request_list(self, message: Any) -> Iterable[object]:
        """Answer MISSION_REQUEST_LIST with the number of items."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        kind = message.mission_type
        if self._upload is not None:
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
        if seq == 0 and self.habits.home_is_first and kind == _MISSION and home is not None:
            item = Item(0, 16, 1, 0.0, 0.0, 0.0, 0.0, int(home[0] * 1e7), int(home[1] * 1e7), home[2])
        now_flown = int(kind == _MISSION and seq == self.current)
        frame = self.habits.frames_told.get(item.frame, item.frame)
        numbers = (seq, frame, item.command, now_flown, item.autocontinue)
        params = (item.p1, item.p2, item.p3, item.p4)
        if message.get_type() == "MISSION_REQUEST":
            place = (item.x / 1e7, item.y / 1e7, item.z)
            return [mav.MAVLink_mission_item_message(system, component, *numbers, *params, *place, kind)]
        place = (item.x, item.y, item.z)
        return [mav.MAVLink_mission_item_int_message(system, component, *numbers, *params, *place, kind)]

    def clear(self, message: Any) -> Iterable[Any]:
        """Forget a plan, or all of them (MISSION_CLEAR_ALL); ArduPilot refuses while it flies it."""
        system, component = message.get_srcSystem(), message.get_srcComponent()
        result = mav.MAV_MISSION_ACCEPTED
        if self.state == ACTIVE and self.habits.home_is_first:
            result = mav.MAV_MISSION_ERROR
        elif message.mission_type == mav.MAV_MISSION_TYPE_ALL:
            self._plans.clear()
            self._rewind()
        else:
            self._plans.pop(message.mission_type, None)
            self._rewind()
        return [mav.MAVLink_mission_ack_message(system, component, result, message.mission_type)]

    def set_current(self, seq: int) -> bool:
        """Go on with another item; False when there is none of that number."""
        if not 0 <= seq < len(self.items):
            return False
        self.current = max(seq, self.first)
        if self.state == COMPLETE:
            self.state = NOT_STARTED
        return True

    def _request(self, upload: _Upload) -> object:
        return self.habits.request(upload.system, upload.component, len(upload.items), upload.kind)

    def _ack(self, upload: _Upload, result: int) -> object:
        return mav.MAVLink_mission_ack_message(upload.system, upload.component, result, upload.kind)


def _item_of(message: Any) -> Item:
    """Return the item in MISSION_ITEM_INT, or in MISSION_ITEM, whose x and y are degrees."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        x, y = int(x * 1e7), int(y * 1e7)
    params = (message.param1, message.param2, message.param3, message.param4)
    return Item(message.frame, message.command, message.autocontinue, *params, x, y, message.z)
