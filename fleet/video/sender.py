"""Video stream of one camera: started by ``start_video``, ended by ``stop_video`` or a failure."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TypeVar

from aiortc import RTCIceServer

from fleet.camera.camera import Camera
from fleet.camera.picture import Picture
from fleet.clock import Clock
from fleet.errors import Refused, TimedOut
from fleet.video.peer import VideoPeer
from fleet.video.signals import IceCandidate, VideoStream, offer_message
from fleet.video.track import CameraTrack

log = logging.getLogger(__name__)

T = TypeVar("T")

FIRST_PICTURE = 3.0  # s to wait for the first picture; less than the 4 s that the edge waits for our reply
OFFER = 0.5  # s to wait for the offer; aiortc asks an ICE server that does not answer for 5 s


class VideoSender:
    """Sends the pictures of one camera to one peer; ``offer`` publishes an offer. On the event loop only.

    ``session`` names this program; ``rate`` is the maximum number of pictures a second.
    """

    def __init__(
        self,
        camera: str,
        *,
        sensor: str,
        session: str,
        rate: float,
        ice_servers: Sequence[RTCIceServer],
        offer: Callable[[dict[str, object]], None],
        clock: Clock,
    ) -> None:
        self.sensor = sensor
        self._camera = Camera(camera)
        self._session = session
        self._rate = rate
        self._ice_servers = ice_servers
        self._offer = offer
        self._clock = clock
        self._changing = asyncio.Lock()
        self._peer: VideoPeer | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._config: dict[str, object] = {}
        self._starts = 0
        self.local = False  # whether the viewer of the last start is on the bus
        self._began = 0.0
        self._counted = (0, 0.0)  # frames, and when they were counted

    async def start(self, *, recording: bool, local: bool = False) -> None:
        """Offer the stream, unless it is connected; raises CommandError without a picture or an offer.

        A stream that still waits for an answer is offered again: the last offer may have been lost. A viewer
        on the bus (``local``) does not take the place of one that is connected, nor is it replaced: each
        would believe that it sees the robot.
        """
        async with self._changing:
            if self._peer is not None and self._peer.connected:
                if not (local or self.local):
                    return
                raise Refused("its video goes to another viewer", hint="send stop_video first")
            await self._close()
            self.local = local
            picture = await self._first_picture()
            self._starts += 1
            self._began = self._clock.monotonic()
            self._counted = (0, self._began)
            self._config = {
                "kind": "camera",
                "source": self._camera.source.partition(":")[0],  # only the scheme: a URL may hold a password
                "resolution": f"{picture.width}x{picture.height}",
                "fps": self._rate,
            }
            track = CameraTrack(self._camera, self._rate, self._clock)
            self._peer = VideoPeer(track, self._ice_servers, self._ended)
            offering = self._begin(self._make_offer(self._peer, picture, recording=recording))
            await asyncio.wait({offering}, timeout=OFFER)
            if offering.done() and (why := offering.result()):
                raise Refused(why)

    async def _make_offer(self, peer: VideoPeer, picture: Picture, *, recording: bool) -> str:
        """Publish the offer once all local candidates are known, unless the stream has ended by then.

        Return an empty text, or why there is no offer; the stream has then ended.
        """
        try:
            sdp = await peer.offer()
        except Exception as error:  # noqa: BLE001 - aiortc raises any kind of exception
            why = f"no offer could be made: {error!r}"
            if peer is self._peer:
                self._ended(why)
            return why
        if peer is self._peer:
            self._offer(
                offer_message(
                    sdp,
                    VideoStream(self.sensor, peer.track.id, f"{self._session}_{self.sensor}"),
                    recording=recording,
                    attributes={"width": picture.width, "height": picture.height, "fps": self._rate},
                    stamp=self._clock.time(),
                    target="console" if self.local else "backend",
                )
            )
        return ""

    async def stop(self) -> None:
        """End the stream, if there is one, and close the camera."""
        async with self._changing:
            await self._close()

    async def answered(self, sdp: str) -> None:
        """Apply the answer to the offer; raises WireError."""
        if self._peer is not None:
            await self._peer.answered(sdp)

    async def add(self, candidate: IceCandidate) -> None:
        """Add a candidate of the peer; raises WireError."""
        if self._peer is not None:
            await self._peer.add(candidate)

    def state(self) -> dict[str, object] | None:
        """Return the state of the stream for the bus (``fleet.wire.streams``), None if there is none.

        ``fps`` is measured since the last call.
        """
        peer = self._peer
        if peer is None:
            return None
        now, frames = self._clock.monotonic(), peer.track.frames
        (before, at), self._counted = self._counted, (frames, now)
        return {
            "camera_id": self.sensor,
            "connection_state": "connected" if peer.connected else "connecting",
            "ice_connection_state": peer.ice_state,
            "frames_sent": frames,
            "last_frame_ts": peer.track.last_frame,
            "fps": (frames - before) / (now - at) if now > at else 0.0,
            "uptime_seconds": now - self._began,
            "restart_count": self._starts - 1,
            "stream_config": self._config,
        }

    async def _first_picture(self) -> Picture:
        """Return the first picture, so that a camera without pictures is refused before the offer."""
        try:
            async with asyncio.timeout(FIRST_PICTURE):
                return await self._camera.picture()
        except TimeoutError:
            raise TimedOut(f"{self._camera.source} gives no picture within {FIRST_PICTURE:g} s") from None

    async def _close(self) -> None:
        """Close the connection and the camera, if open."""
        peer, self._peer = self._peer, None
        if peer is not None:
            await peer.close()
            await self._camera.close()

    def _ended(self, why: str) -> None:
        """Clean up after a stream that ended by itself."""
        log.warning("video of %s ended: %s", self.sensor, why)
        self._begin(self._clear(self._peer))

    def _begin(self, work: Coroutine[object, object, T]) -> asyncio.Task[T]:
        """Start a task that is kept alive until it ends."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _clear(self, peer: VideoPeer | None) -> None:
        """Close a peer, unless it has been replaced meanwhile."""
        async with self._changing:
            if peer is self._peer:
                await self._close()
