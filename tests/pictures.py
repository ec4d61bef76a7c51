"""Pictures of one colour, and a camera that shows them: for tests of photos and video."""

from fractions import Fraction

import av

RED, BLUE = (76, 85, 255), (29, 255, 107)  # Y, Cb and Cr
WIDTH, HEIGHT = 320, 240


def jpeg(colour):
    """Return a picture of one colour."""
    encoder = av.VideoCodecContext.create("mjpeg", "w")
    encoder.width, encoder.height, encoder.pix_fmt, encoder.time_base = (
        WIDTH,
        HEIGHT,
        "yuvj420p",
        Fraction(1, 10),
    )
    frame = av.VideoFrame(WIDTH, HEIGHT, "yuvj420p")
    for plane, value in zip(frame.planes, colour, strict=True):
        plane.update(bytes([value]) * plane.buffer_size)
    return b"".join(bytes(packet) for packet in [*encoder.encode(frame), *encoder.encode(None)])


class CameraFile:
    """A file that a camera's program writes its newest picture to."""

    def __init__(self, path):
        self.path = path
        self.source = f"file:{path}"
        self.show(RED)

    def show(self, colour):
        """Show a colour from now on."""
        new = self.path.with_suffix(".new")
        new.write_bytes(jpeg(colour))
        new.replace(self.path)

    def breaks(self):
        """Give no picture any more."""
        self.path.unlink()
