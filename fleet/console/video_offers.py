"""Offers of live video by programs on the bus, passed to the page that waits for one; on the event loop."""

from __future__ import annotations

import asyncio

import msgspec

from fleet.errors import Refused, TimedOut, WireError
from fleet.runtime.decoding import json_decoder
from fleet.wire.samples import json_payload

OFFERED_WITHIN = 8.0  # s; the edge waits 4 s for the program, which may need 5 s for its candidates
LARGEST = 64 * 1024  # bytes of an offer


class VideoOffer(msgspec.Struct, frozen=True):
    """One offer: the program's session description, and the sensor of its pictures."""

    sdp: str
    sensor: str = ""


_OFFER: msgspec.json.Decoder[VideoOffer] = json_decoder(VideoOffer)


class VideoOffers:
    """Passes the next offer of a robot to the single page that waits for it.

    A program sends to one viewer. So a second page is refused: both would answer the same offer.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, asyncio.Future[VideoOffer]] = {}

    async def next(self, robot: str, within: float = OFFERED_WITHIN) -> VideoOffer:
        """Return the next offer of a robot (``edge/robot``); raises Refused, or TimedOut without one."""
        if robot in self._waiting:
            raise Refused("another page asks for this video")
        offered: asyncio.Future[VideoOffer] = asyncio.get_running_loop().create_future()
        self._waiting[robot] = offered
        try:
            async with asyncio.timeout(within):
                return await offered
        except TimeoutError:
            raise TimedOut("no program on the bus offers video of this robot") from None
        finally:
            del self._waiting[robot]

    def receive(self, robot: str, sample: bytes) -> None:
        """Receive an offer from the bus; one without a waiting page, or an unreadable one, is ignored."""
        waiting = self._waiting.get(robot)
        if waiting is None or waiting.done() or len(sample) > LARGEST:
            return
        try:
            waiting.set_result(_OFFER.decode(json_payload(sample)))
        except (WireError, msgspec.DecodeError, ValueError, RecursionError):
            return
