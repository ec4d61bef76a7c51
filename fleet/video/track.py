"""WebRTC track that sends the pictures of a camera."""

from __future__ import annotations

import asyncio
from fractions import Fraction

import av
from aiortc import MediaStreamTrack
from aiortc.mediastreams import MediaStreamError

from fleet.camera.camera import Camera
from fleet.camera.picture import Picture
from fleet.clock import Clock
from fleet.errors import CommandError, Refused

STALLED = 3.0  # s without a picture after which the track ends: an old picture must not be taken for live
TICKS = 90_000  # Hz, the RTP clock rate of video


class CameraTrack(MediaStreamTrack):
    """Video track that delivers each picture once, at most ``rate`` a second.

    ``last_frame`` is Unix seconds, ``failure`` says why the track ended by itself.
    """

    kind = "video"

    def __init__(self, camera: Camera, rate: float, clock: Clock) -> None:
        super().__init__()
        self._camera = camera
        self._period = 1.0 / rate
        self._clock = clock
        self._began = self._due = clock.monotonic()
        self._decoder = jpeg_decoder()
        self._trouble = ""  # last error of the camera
        self.frames = 0
        self.last_frame: float | None = None
        self.failure = ""

    async def recv(self) -> av.VideoFrame:
        """Return the next picture when it is due; the track ends when the camera stays silent."""
        await asyncio.sleep(max(0.0, self._due - self._clock.monotonic()))
        try:
            async with asyncio.timeout(STALLED):
                frame = await self._next()
        except TimeoutError:
            self.failure = self._trouble or f"{self._camera.source} gave no picture for {STALLED:g} s"
            self.stop()
            raise MediaStreamError from None
        now = self._clock.monotonic()
        self._due = max(self._due + self._period, now)
        frame.pts, frame.time_base = int((now - self._began) * TICKS), Fraction(1, TICKS)
        self.frames += 1
        self.last_frame = self._clock.time()
        return frame

    async def _next(self) -> av.VideoFrame:
        """Return the next picture, retrying after failures of the camera."""
        self._trouble = ""
        while True:
            try:
                picture = await self._camera.picture()
                return await asyncio.to_thread(decoded, self._decoder, picture)
            except CommandError as error:
                self._trouble = str(error)
                await asyncio.sleep(self._period)


def jpeg_decoder() -> av.VideoCodecContext:
    """Return a JPEG decoder that delivers each picture at once."""
    decoder = av.VideoCodecContext.create("mjpeg", "r")
    decoder.thread_count = 1  # frame threading would hold pictures back
    return decoder


def decoded(decoder: av.VideoCodecContext, picture: Picture) -> av.VideoFrame:
    """Decode a picture to the form that encoders need: YUV 4:2:0, even sides. Raises Refused if damaged."""
    if not picture.data:  # an empty packet would end the decoder: it would refuse all later pictures
        raise Refused("the camera's picture is empty")
    try:
        frames = decoder.decode(av.Packet(picture.data))
    except av.FFmpegError as error:
        raise Refused(f"the camera's picture cannot be decoded: {error}") from None
    if not frames:
        raise Refused("the camera's picture cannot be decoded")
    frame = frames[0]
    return frame.reformat(width=frame.width & ~1, height=frame.height & ~1, format="yuv420p")
