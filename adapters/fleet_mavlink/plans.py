"""Plans in the autopilot's memory (missions, fences): uploaded, downloaded, cleared.

The autopilot requests each item, ArduPilot with MISSION_REQUEST and PX4 with MISSION_REQUEST_INT, and again
if the answer takes long. If both requests are answered, ArduPilot reports 13 (INVALID_SEQUENCE) for the
second answer and continues. Therefore all received messages are read before the newest request is answered,
and 13 does not end a transfer.
"""

from __future__ import annotations

import asyncio
import enum
from collections.abc import Callable, Sequence

import msgspec

from fleet import Refused, TimedOut
from fleet_mavlink.constants import AUTOPILOT
from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.mission_messages import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
)
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.received_messages import ReceivedMessages
from fleet_mavlink.vehicle import Vehicle

_SILENCE = 1.5  # s of silence after which our message is repeated
_TRIES = 5
_TRANSFERS = 3  # of one plan: the vehicle aborts one in which it hears nothing for some seconds
_ITEM_TRIES = 50  # requests for the same item
_ACCEPTED, _INVALID_SEQUENCE, _DENIED, _CANCELLED = 0, 13, 14, 15
_OF_UPLOADS = frozenset({_INVALID_SEQUENCE, _CANCELLED})
_RESULTS = (
    "ACCEPTED",
    "ERROR",
    "UNSUPPORTED_FRAME",
    "UNSUPPORTED",
    "NO_SPACE",
    "INVALID",
    "INVALID_PARAM1",
    "INVALID_PARAM2",
    "INVALID_PARAM3",
    "INVALID_PARAM4",
    "INVALID_PARAM5_X",
    "INVALID_PARAM6_Y",
    "INVALID_PARAM7",
    "INVALID_SEQUENCE",
    "DENIED",
    "OPERATION_CANCELLED",
)

_Said = MissionRequest | MissionRequestInt | MissionAck | MissionCount | MissionItemInt
_KINDS: tuple[type[_Said], ...] = (
    MissionRequest,
    MissionRequestInt,
    MissionAck,
    MissionCount,
    MissionItemInt,
)
_DOWNLOAD_ANSWERS = (MissionCount, MissionItemInt)  # answers to a download


class PlanType(enum.IntEnum):
    """MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1


class Plans:
    """Plans of one vehicle, one transfer at a time. Errors: Refused, TimedOut, NotReady, LinkLost."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._lock = asyncio.Lock()

    async def upload(self, kind: PlanType, items: Sequence[MissionItemInt]) -> None:
        """Replace a plan by these items; they are numbered and addressed here.

        Confirm the result with ``download``: the vehicle's final acknowledgement may have been lost.
        """
        async with self._lock:
            require_connection(self._vehicle)
            with self._vehicle.hearing(*_KINDS) as heard:
                for _ in range(_TRANSFERS):
                    require_connection(self._vehicle)
                    sent = await self._send_all(kind, items, heard)
                    if sent == len(items):
                        break
        if sent < len(items):
            raise TimedOut(
                f"system {self._vehicle.system} stopped asking for its {kind.name.lower()}",
                hint=f"{sent} of {len(items)} items were sent; is the link good?",
            )

    async def download(self, kind: PlanType) -> tuple[MissionItemInt, ...]:
        """Return the items of a plan as stored in the vehicle."""
        async with self._lock:
            require_connection(self._vehicle)
            with self._vehicle.hearing(*_KINDS) as heard:
                count = await self._count(kind, heard)
                items = tuple([await self._item(kind, seq, heard) for seq in range(count)])
            self._send(MissionAck(0, 0, _ACCEPTED, kind))
            return items

    async def clear(self, kind: PlanType) -> None:
        """Delete a plan."""
        async with self._lock:
            require_connection(self._vehicle)
            with self._vehicle.hearing(*_KINDS) as heard:
                request = MissionClearAll(0, 0, kind)
                ack = await self._answer(
                    request, heard, lambda said: isinstance(said, MissionAck) and said.mission_type == kind
                )
        _require_accepted(ack, f"to forget its {kind.name.lower()}")

    async def _send_all(
        self, kind: PlanType, items: Sequence[MissionItemInt], heard: ReceivedMessages[_Said]
    ) -> int:
        """Announce the items and answer requests until the vehicle acknowledges the plan.

        Return the number of requested items: fewer than all if the vehicle gave up.
        """
        requested: dict[int, int] = {}
        tries = 0
        while tries < _TRIES:
            if not requested:
                self._send(MissionCount(0, 0, len(items), kind))
            said = await self._newest(kind, heard)
            if said is None and len(requested) == len(items):
                break  # the final acknowledgement may be lost: the read-back decides
            if said is None:
                tries += 1
            elif isinstance(said, MissionAck):
                if said.type == _CANCELLED:
                    break
                _require_accepted(said, f"the {kind.name.lower()}")
                return len(items)
            else:
                tries = 0
                self._answer_request(kind, items, said.seq, requested)
        return len(requested)

    def _answer_request(
        self, kind: PlanType, items: Sequence[MissionItemInt], seq: int, requested: dict[int, int]
    ) -> None:
        """Send the requested item; raises Refused for one beyond the plan."""
        if not 0 <= seq < len(items):
            raise Refused(f"system {self._vehicle.system} asks for item {seq} of {len(items)}")
        requested[seq] = requested.get(seq, 0) + 1
        if requested[seq] > _ITEM_TRIES:
            raise TimedOut(f"system {self._vehicle.system} does not take item {seq}")
        self._send(msgspec.structs.replace(items[seq], seq=seq, mission_type=kind))

    async def _newest(
        self, kind: PlanType, heard: ReceivedMessages[_Said]
    ) -> MissionRequest | MissionRequestInt | MissionAck | None:
        """Return the newest request, or the end, among the received messages; None without any."""

        def counts(said: _Said) -> bool:
            late = isinstance(said, MissionAck) and said.type == _INVALID_SEQUENCE
            return said.mission_type == kind and not late and not isinstance(said, _DOWNLOAD_ANSWERS)

        newest = await heard.first(counts, _SILENCE)
        while newest is not None and not isinstance(newest, MissionAck):
            later = await heard.first(counts, 0.001)
            if later is None:
                break
            newest = later
        return None if isinstance(newest, _DOWNLOAD_ANSWERS) else newest

    async def _count(self, kind: PlanType, heard: ReceivedMessages[_Said]) -> int:
        """Return the number of items; after an aborted upload ArduPilot first refuses to send it."""
        for _ in range(_TRIES):
            said = await self._answer(
                MissionRequestList(0, 0, kind),
                heard,
                lambda said: said.mission_type == kind and isinstance(said, MissionCount | MissionAck),
            )
            if isinstance(said, MissionCount):
                return said.count
            if isinstance(said, MissionAck) and said.type != _DENIED:
                _require_accepted(said, f"to send its {kind.name.lower()}")
            await asyncio.sleep(_SILENCE)
        raise Refused(f"system {self._vehicle.system} does not send its {kind.name.lower()}")

    async def _item(self, kind: PlanType, seq: int, heard: ReceivedMessages[_Said]) -> MissionItemInt:
        """Return one item."""
        said = await self._answer(
            MissionRequestInt(0, 0, seq, kind),
            heard,
            lambda said: (
                said.mission_type == kind
                and (isinstance(said, MissionAck) or (isinstance(said, MissionItemInt) and said.seq == seq))
            ),
        )
        if not isinstance(said, MissionItemInt):
            raise Refused(f"system {self._vehicle.system} does not send item {seq}: {_name(said)}")
        return said

    async def _answer(
        self, request: MavlinkMessage, heard: ReceivedMessages[_Said], wanted: Callable[[_Said], bool]
    ) -> _Said:
        """Send a request until the answer arrives; raises TimedOut.

        What only an upload has is its late end, or the late answer to a repeated item.
        """

        def answers(said: _Said) -> bool:
            return wanted(said) and not (isinstance(said, MissionAck) and said.type in _OF_UPLOADS)

        for _ in range(_TRIES):
            self._send(request)
            said = await heard.first(answers, _SILENCE)
            if said is not None:
                return said
        raise TimedOut(f"system {self._vehicle.system} did not answer {type(request).__name__}")

    def _send(self, message: MavlinkMessage) -> None:
        """Send a message, addressed."""
        self._vehicle.send(
            msgspec.structs.replace(message, target_system=self._vehicle.system, target_component=AUTOPILOT)
        )


def _require_accepted(said: _Said, what: str) -> None:
    """Raise Refused unless it was accepted."""
    if not isinstance(said, MissionAck) or said.type != _ACCEPTED:
        raise Refused(f"the autopilot refused {what}: {_name(said)}", device_result=_name(said))


def _name(said: _Said) -> str:
    """Return the name of a MAV_MISSION_RESULT."""
    if not isinstance(said, MissionAck):
        return type(said).__name__
    return _RESULTS[said.type] if said.type < len(_RESULTS) else f"result {said.type}"
