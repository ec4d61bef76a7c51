"""One viewer: a WebSocket that receives its subscribed channels and may send nothing else."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable

from starlette.websockets import WebSocket, WebSocketDisconnect

from fleet.clock import Clock
from fleet.console.foxglove.backlog import Backlog
from fleet.console.foxglove.channels import Channels, Sample
from fleet.console.foxglove.protocol import (
    FoxgloveChannel,
    FoxgloveSubscription,
    Subscribe,
    ViewerRequest,
    advertisement,
    message_data,
    read_requested,
    server_info,
    warning,
)
from fleet.errors import WireError

MOST_BAD = 16  # refused messages after which a viewer is closed
POLICY = 1008  # close code of RFC 6455: policy violation
TELL_EVERY = 5.0  # s between warnings about dropped samples


class Viewer:
    """Serves one accepted WebSocket. ``changed`` is called when its subscriptions change."""

    def __init__(
        self, socket: WebSocket, channels: Channels, clock: Clock, changed: Callable[[], None]
    ) -> None:
        self._socket = socket
        self._channels = channels
        self._clock = clock
        self._changed = changed
        self._subscriptions: dict[int, int] = {}  # of the client, by channel
        self._backlog = Backlog()
        self._wakeup = asyncio.Event()
        self._offered = 0
        self._warned_at = float("-inf")

    @property
    def wanted(self) -> Iterable[int]:
        """The subscribed channels."""
        return self._subscriptions.keys()

    def offer(self, samples: Iterable[Sample]) -> None:
        """Queue new samples, and announce new channels."""
        now = self._clock.monotonic()
        for sample in samples:
            if sample.channel in self._subscriptions:
                self._backlog.add(sample, now)
        if self._backlog or self._offered < len(self._channels.all):
            self._wakeup.set()

    async def run(self, session: str) -> None:
        """Serve until either side closes."""
        sending = asyncio.create_task(self._send(session), name="foxglove:send")
        try:
            await self._listen()
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

    async def _send(self, session: str) -> None:
        """Send new samples; the backlog is conflated meanwhile."""
        await self._socket.send_text(server_info(session))
        await self._socket.send_text(advertisement(self._new_channels()))
        while True:
            await self._wakeup.wait()
            self._wakeup.clear()
            if self._offered < len(self._channels.all):
                await self._socket.send_text(advertisement(self._new_channels()))
            for sample in self._backlog.take():
                subscription = self._subscriptions.get(sample.channel)
                if subscription is not None:
                    await self._socket.send_bytes(message_data(subscription, sample.received, sample.payload))
            await self._report_lost()

    def _new_channels(self) -> list[FoxgloveChannel]:
        """Return the channels that were not offered yet."""
        new = self._channels.all[self._offered :]
        self._offered += len(new)
        return new

    async def _report_lost(self) -> None:
        """Warn periodically of dropped samples."""
        now = self._clock.monotonic()
        if self._backlog.lost and now - self._warned_at >= TELL_EVERY:
            lost, self._backlog.lost, self._warned_at = self._backlog.lost, 0, now
            text = f"{lost} older messages were left out: this viewer reads too slowly"
            await self._socket.send_text(warning(text))

    async def _listen(self) -> None:
        """Handle the requests of the viewer."""
        bad = 0
        while bad < MOST_BAD:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            try:
                self._handle(read_requested(text if text is not None else message.get("bytes") or b""))
            except WireError as error:
                bad += 1
                await self._socket.send_text(warning(str(error)))
        await self._socket.close(POLICY)

    def _handle(self, requested: ViewerRequest) -> None:
        """Begin or end subscriptions; a new one gets the newest sample at once. Raises WireError."""
        if isinstance(requested, Subscribe):
            for each in requested.subscriptions:
                self._subscribe(each)
        else:
            ended = set(requested.subscription_ids)
            self._subscriptions = {
                channel: each for channel, each in self._subscriptions.items() if each not in ended
            }
        self._changed()

    def _subscribe(self, requested: FoxgloveSubscription) -> None:
        """Begin one subscription; raises WireError."""
        if not 1 <= requested.channel_id <= len(self._channels.all):
            raise WireError(f"there is no channel {requested.channel_id}")
        if requested.channel_id in self._subscriptions or requested.id in self._subscriptions.values():
            raise WireError(
                f"channel {requested.channel_id} or subscription {requested.id} is subscribed already"
            )
        self._subscriptions[requested.channel_id] = requested.id
        newest = self._channels.newest.get(requested.channel_id)
        if newest is not None:
            self._backlog.add(newest, self._clock.monotonic())
            self._wakeup.set()
