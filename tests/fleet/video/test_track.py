"""A camera's pictures become frames: each once, no faster than wanted, and never an old one."""

import asyncio
from fractions import Fraction

import av
import pytest
from aiortc.mediastreams import MediaStreamError

from fleet.camera.picture import Picture
from fleet.errors import Refused, TimedOut
from fleet.runtime.simulated_time import EPOCH, JumpingLoop, LoopClock
from fleet.video.track import STALLED, TICKS, CameraTrack, decoded, jpeg_decoder

RATE = 10.0  # Hz
RED, BLUE = (76, 85, 255), (29, 255, 107)  # Y, Cb and Cr


def picture(colour=RED, width=32, height=16):
    """Return a picture of one colour."""
    encoder = av.VideoCodecContext.create("mjpeg", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, height, "yuvj420p"
    encoder.time_base = Fraction(1, 10)
    frame = av.VideoFrame(width, height, "yuvj420p")
    for plane, value in zip(frame.planes, colour, strict=True):
        plane.update(bytes([value]) * plane.buffer_size)
    data = b"".join(bytes(packet) for packet in [*encoder.encode(frame), *encoder.encode(None)])
    return Picture(data, width, height)


class Camera:
    """A camera that takes ``takes`` seconds for each of its pictures; an error is raised, None hangs."""

    source = "file:/camera.jpg"

    def __init__(self, *pictures, takes=0.0):
        self.pictures, self.takes = list(pictures), takes

    async def picture(self):
        await asyncio.sleep(self.takes)
        taken = self.pictures.pop(0) if len(self.pictures) > 1 else self.pictures[0]
        if taken is None:
            await asyncio.Event().wait()
        if isinstance(taken, Exception):
            raise taken
        return taken


class Played:
    """What a track has delivered."""

    def __init__(self, camera):
        loop = asyncio.get_running_loop()
        self.track = CameraTrack(camera, RATE, LoopClock(loop))
        self.began, self.frames, self.times, self.time = loop.time(), [], [], loop.time

    async def read(self, number):
        for _ in range(number):
            self.frames.append(await self.track.recv())
            self.times.append(round(self.time() - self.began, 6))


def played(camera, number, *, pause=0.0):
    """Return what a track delivers to a reader that pauses before the last three, or until it ends."""

    async def whole():
        found = Played(camera)
        try:
            await found.read(number - 3)
            await asyncio.sleep(pause)
            await found.read(min(number, 3))
        except MediaStreamError:
            found.ended_after = found.time() - found.began
        return found

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


def luminance(frame):
    return bytes(frame.planes[0])[0]


def test_pictures_come_at_the_rate_with_the_time_at_which_they_were_taken():
    found = played(Camera(picture()), 4)
    assert found.times == [0.0, 0.1, 0.2, 0.3]
    assert [frame.pts for frame in found.frames] == [
        pytest.approx(time * TICKS, abs=1) for time in found.times
    ]
    assert {frame.time_base for frame in found.frames} == {Fraction(1, TICKS)}
    assert (found.track.frames, found.track.failure) == (4, "")


def test_a_camera_that_is_slower_than_the_rate_sets_it():
    assert played(Camera(picture(), takes=0.25), 4).times == [0.25, 0.5, 0.75, 1.0]


def test_what_was_not_read_in_time_is_not_made_up_for():
    found = played(Camera(picture()), 5, pause=5.0)
    assert found.times == [0.0, 0.1, 5.1, 5.1, 5.2], "one is read at once, for a camera that takes its time"
    assert found.track.last_frame == pytest.approx(EPOCH + 5.2)


def test_each_picture_is_the_next_one():
    found = played(Camera(picture(RED), picture(BLUE), picture(RED)), 3)
    red, blue, last = map(luminance, found.frames)
    assert (abs(red - blue) > 30, red) == (True, last)


def test_a_camera_that_fails_for_a_moment_costs_some_pictures():
    camera = Camera(Refused("no such file"), picture())
    found = played(camera, 1)
    assert (found.times, found.track.failure) == ([0.1], "")


ENDS = [
    (Camera(Refused("no such file")), "no such file"),
    (Camera(TimedOut("it does not answer")), "it does not answer"),
    (Camera(None), "file:/camera.jpg gave no picture for 3 s"),
    (Camera(Refused("busy"), None), "busy"),
    (Camera(Picture(b"nonsense", 1, 1)), "the camera's picture cannot be decoded"),
]


@pytest.mark.parametrize(("camera", "why"), ENDS)
def test_a_track_without_a_picture_for_some_seconds_ends_with_the_reason(camera, why):
    found = played(camera, 1)
    assert found.frames == []
    assert found.ended_after == pytest.approx(STALLED)
    assert found.track.failure.startswith(why)
    assert found.track.readyState == "ended"


def test_a_trouble_that_is_over_is_not_the_reason_of_a_later_end():
    found = played(Camera(Refused("busy"), picture(), None), 2)
    assert (len(found.frames), found.track.failure) == (1, "file:/camera.jpg gave no picture for 3 s")


@pytest.mark.parametrize(
    ("size", "even"), [((32, 16), (32, 16)), ((33, 16), (32, 16)), ((32, 17), (32, 16)), ((35, 19), (34, 18))]
)
def test_frames_have_even_sides_as_encoders_need_them(size, even):
    frame = decoded(jpeg_decoder(), picture(RED, *size))
    assert ((frame.width, frame.height), frame.format.name) == (even, "yuv420p")


@pytest.mark.parametrize("data", [b"nonsense", b"\xff\xd8\xff\xd9"])
def test_a_damaged_picture_is_refused_and_the_next_one_is_read(data):
    decoder = jpeg_decoder()
    with pytest.raises(Refused, match="the camera's picture cannot be decoded"):
        decoded(decoder, Picture(data, 1, 1))
    assert decoded(decoder, picture()).width == 32


def test_an_empty_picture_is_refused_and_the_next_one_is_read():
    decoder = jpeg_decoder()
    with pytest.raises(Refused, match="the camera's picture is empty"):
        decoded(decoder, Picture(b"", 1, 1))
    assert decoded(decoder, picture()).width == 32
