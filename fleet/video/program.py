"""Main part of the video program: joins the bus, starts and stops video on request, reports its stream."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import os
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from pathlib import Path

import msgspec
from aiortc import RTCIceServer

from fleet.bus import keys
from fleet.bus.bus import join
from fleet.bus.settings import BusSettings
from fleet.bus.zenoh_session import Query, ZenohSession
from fleet.clock import Clock
from fleet.errors import CommandError, WireError
from fleet.video.sender import VideoSender
from fleet.video.signals import answer_for, candidate_in
from fleet.wire.encoding import encode_finite
from fleet.wire.samples import json_sample
from fleet.wire.streams import CHANNEL, LIFETIME
from fleet.wire.topics import data_key
from fleet.wire.video import LOCAL_ANSWER, LOCAL_OFFER, VideoReply, VideoRequest, read_video_request

log = logging.getLogger(__name__)

TELL_EVERY = LIFETIME / 5  # s between two reports of the stream


class CameraSource(msgspec.Struct, frozen=True):
    """Camera to send: ``camera`` as in fleet.yaml, at most ``rate`` pictures a second."""

    robot: str
    twin: str
    camera: str
    sensor: str
    rate: float
    ice_servers: Sequence[RTCIceServer] = ()


async def send_video(
    source: CameraSource, settings: BusSettings, directory: Path, ended: asyncio.Event, clock: Clock
) -> None:
    """Serve one camera of one robot until ``ended``; raises BusError when the bus cannot be joined."""
    bus = await asyncio.to_thread(join, settings, directory)
    program = _VideoProgram(source, bus.reports, clock)
    try:
        program.declare(keys.video(settings.edge, source.robot))
        log.info("video of %s waits for start_video", source.robot)
        while not ended.is_set():
            program.publish_state()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(TELL_EVERY):
                    await ended.wait()
    finally:
        await program.close()
        await asyncio.to_thread(bus.close)


class _VideoProgram:
    """Bus side of the program: requests, WebRTC messages and the stream's state."""

    def __init__(self, source: CameraSource, bus_session: ZenohSession, clock: Clock) -> None:
        self._bus_session = bus_session
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._count = itertools.count()
        self._stream_key = data_key(source.twin, CHANNEL, source.sensor)
        self._twin = source.twin
        self._published = False
        self._tasks: set[asyncio.Task[None]] = set()
        self._sender = VideoSender(
            source.camera,
            sensor=source.sensor,
            session=f"video_{source.robot}_{os.getpid()}",
            rate=source.rate,
            ice_servers=source.ice_servers,
            offer=self._offer,
            clock=clock,
        )

    def declare(self, key: str) -> None:
        """Serve requests on ``key``, and subscribe to the peer's answers and candidates."""
        self._bus_session.declare_queryable(key, self._on_loop(self._requested))
        for channel, local in (("cloud/webrtc_answer", False), (LOCAL_ANSWER, True)):
            answered = self._on_loop(partial(self._answered, local))
            self._bus_session.subscribe(data_key(self._twin, channel), answered)
        self._bus_session.subscribe(
            data_key(self._twin, "cloud/webrtc_candidate"), self._on_loop(self._candidate)
        )

    def publish_state(self) -> None:
        """Publish the state of the stream; after its end, once, an empty sample."""
        stream = self._sender.state()
        if stream is not None:
            self._put(self._stream_key, stream)
        elif self._published:
            self._bus_session.put(self._stream_key, b"")
        self._published = stream is not None

    async def close(self) -> None:
        """End the stream and publish its end."""
        await self._sender.stop()
        self.publish_state()

    def _on_loop(self, handle: Callable[..., Coroutine[object, object, None]]) -> Callable[..., None]:
        """Return a callback for Zenoh's threads that runs ``take`` on the event loop."""

        def begin(*arguments: object) -> None:
            task = self._loop.create_task(handle(*arguments))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

        def arrived(*arguments: object) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(begin, *arguments)

        return arrived

    async def _requested(self, question: Query) -> None:
        """Handle a request to start or stop video, and reply."""
        try:
            request = read_video_request(question.payload)
            await self._do(request)
        except (CommandError, WireError) as error:
            reply = VideoReply(ok=False, reason=str(error))
        except Exception as error:
            log.exception("a request for video failed")
            reply = VideoReply(ok=False, reason=f"the video program failed: {error!r}")
        else:
            log.info("%s: done", request.command)
            reply = VideoReply(ok=True)
        question.reply(msgspec.json.encode(reply))
        question.close()

    async def _do(self, request: VideoRequest) -> None:
        """Carry out a request; raises CommandError or WireError."""
        if not request.is_for(self._sender.sensor):
            raise WireError(f"{self._sender.sensor!r} is the sensor that is sent here", where="sensor")
        if request.command == "start_video":
            await self._sender.start(recording=request.recording, local=request.local)
        else:
            await self._sender.stop()
        self.publish_state()

    async def _answered(self, local: bool, _key: str, sample: bytes) -> None:  # noqa: FBT001 - of a partial
        """Handle an answer of the peer; only the viewer that was offered the stream may answer."""
        if local is not self._sender.local:
            return
        try:
            sdp = answer_for(sample, self._sender.sensor)
            if sdp is not None:
                await self._sender.answered(sdp)
        except WireError as error:
            log.warning("an answer was refused: %s", error)

    async def _candidate(self, _key: str, sample: bytes) -> None:
        """Handle a candidate of the peer."""
        try:
            await self._sender.add(candidate_in(sample))
        except WireError as error:
            log.warning("a candidate was refused: %s", error)

    def _offer(self, message: dict[str, object]) -> None:
        """Publish an offer."""
        channel = LOCAL_OFFER if self._sender.local else "webrtc_offer"
        self._put(data_key(self._twin, channel), message)

    def _put(self, key: str, message: dict[str, object]) -> None:
        """Publish a document."""
        payload, stamp = encode_finite(message), self._clock.time()
        self._bus_session.put(key, json_sample(payload, stamp=stamp, sequence=next(self._count)))
