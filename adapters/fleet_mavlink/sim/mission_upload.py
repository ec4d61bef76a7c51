"""Upload of a plan to an autopilot: it requests one item after the other, and acknowledges a complete plan.

The autopilots differ in their request for an item, its repetition, and their reaction to duplicates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.mission_items import MISSION, Item, MissionBehaviour, item_of

_GIVE_UP = 8.0  # s without an item that end an upload
_FIRST_DO = 80  # commands from here on are not navigation
_COUNT_MAX = 700


@dataclass(slots=True)
class _Upload:
    """An upload in progress."""

    system: int
    component: int
    kind: int
    count: int
    items: list[Item]
    requested_at: float
    heard_at: float


class MissionUpload:
    """The upload in progress, if any; ``store`` receives kind and items of a complete one."""

    def __init__(self, behaviour: MissionBehaviour, store: Callable[[int, list[Item]], None]) -> None:
        self._behaviour = behaviour
        self._store = store
        self._under_way: _Upload | None = None

    @property
    def is_under_way(self) -> bool:
        """True while items are missing."""
        return self._under_way is not None

    def reboot(self) -> None:
        """Drop the upload."""
        self._under_way = None

    def overdue(self, now: float) -> Iterable[object]:
        """Request an overdue item again; end a silent upload."""
        upload = self._under_way
        if upload is None:
            return ()
        if now - upload.heard_at > _GIVE_UP:
            self._under_way = None
            return [self._ack(upload, mav.MAV_MISSION_OPERATION_CANCELLED)]
        if now - upload.requested_at < self._behaviour.repeat:
            return ()
        upload.requested_at = now
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
            return self._complete(upload)
        self._under_way = upload
        return [self._request(upload)]

    def item(self, message: Any, now: float) -> Iterable[object]:
        """Process an item of the upload (MISSION_ITEM_INT or MISSION_ITEM)."""
        upload = self._under_way
        if upload is None or message.mission_type != upload.kind:
            return ()
        upload.heard_at = now
        if message.seq != len(upload.items):
            answered = self._behaviour.tells_duplicates
            return [self._ack(upload, mav.MAV_MISSION_INVALID_SEQUENCE)] if answered else ()
        item = item_of(message)
        if upload.kind == MISSION and item.command < _FIRST_DO and item.command not in self._behaviour.flies:
            self._under_way = None
            return [self._ack(upload, mav.MAV_MISSION_UNSUPPORTED)]
        upload.items.append(item)
        if len(upload.items) == upload.count:
            return self._complete(upload)
        upload.requested_at = now
        return [self._request(upload)]

    def _complete(self, upload: _Upload) -> Iterable[object]:
        """Complete an upload: its plan replaces the old one."""
        self._under_way = None
        self._store(upload.kind, upload.items)
        return [self._ack(upload, mav.MAV_MISSION_ACCEPTED)]

    def _request(self, upload: _Upload) -> object:
        return self._behaviour.request(upload.system, upload.component, len(upload.items), upload.kind)

    def _ack(self, upload: _Upload, result: int) -> object:
        return mav.MAVLink_mission_ack_message(upload.system, upload.component, result, upload.kind)
