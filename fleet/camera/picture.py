"""A single JPEG picture of a camera: from a file, a snapshot URL, or a V4L2 device with JPEG output."""

from __future__ import annotations

import asyncio
import http.client
import urllib.error
import urllib.request
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec
from pydantic import Field

from fleet.camera.v4l2 import capture
from fleet.clock import Clock
from fleet.errors import Refused, TimedOut, Unsupported
from fleet.model.report import PhotoReport

TIMEOUT = 5.0  # s within which a camera must answer
LARGEST = 4 * 1024 * 1024  # bytes of a picture; a larger one does not belong on MQTT
_START, _SCAN = 0xD8, 0xDA
_SIZES = frozenset({*range(0xC0, 0xD0)}) - {0xC4, 0xC8, 0xCC}  # start-of-frame markers
_BARE = frozenset({0x01, *range(0xD0, 0xD9)})  # markers without a length


CameraText = Annotated[str, Field(pattern=r"^(file:/|https?://|v4l2:/)\S+$")]
"""Type of a camera field in an adapter's config."""


class Picture(msgspec.Struct, frozen=True):
    """A JPEG picture and its size in pixels."""

    data: bytes
    width: int
    height: int


async def photograph(camera: str | None, clock: Clock) -> PhotoReport:
    """Return the report that ``take_photo`` publishes.

    Raises Unsupported when no camera is configured, Refused or TimedOut like ``take_picture``.
    """
    if camera is None:
        raise Unsupported("no camera is configured", hint="camera: http://... in fleet.yaml")
    picture = await take_picture(camera)
    return PhotoReport(clock.time(), picture.data, "jpeg", picture.width, picture.height)


async def take_picture(source: str) -> Picture:
    """Return a picture from ``file:/...``, ``http(s)://...`` or ``v4l2:/dev/videoN``; never blocks the loop.

    Raises Refused with the reason, TimedOut when the camera does not answer.
    """
    kind, _, rest = source.partition(":")
    return await take_in_thread(partial(_SOURCES[kind], rest, source), source)


async def take_in_thread(read: Callable[[], bytes], source: str) -> Picture:
    """Run ``read`` in a thread and return its picture; raises like ``take_picture``."""
    try:
        async with asyncio.timeout(TIMEOUT + 1.0):
            data = await asyncio.to_thread(read)
    except TimeoutError:
        raise TimedOut(f"{source} does not answer") from None
    except (OSError, urllib.error.URLError, http.client.HTTPException) as error:
        raise Refused(f"{source}: {error}") from None
    if len(data) > LARGEST:
        raise Refused(f"{source}: the picture is larger than {LARGEST // 1024} KiB")
    width, height = jpeg_size(data)
    return Picture(data, width, height)


def _from_file(path: str, _source: str) -> bytes:
    """Return a file's bytes, up to one more than allowed, which marks a file as too large."""
    with Path(path).open("rb") as file:
        return file.read(LARGEST + 1)


def _from_url(_rest: str, source: str) -> bytes:
    """Return the response body of a snapshot URL."""
    with urllib.request.urlopen(source, timeout=TIMEOUT) as answer:  # noqa: S310 - http(s), from fleet.yaml
        take_in_thread: bytes = answer.read(LARGEST + 1)
    return take_in_thread


def _from_device(path: str, _source: str) -> bytes:
    """Return one frame of a V4L2 device."""
    return capture(path, TIMEOUT)


_SOURCES = {"file": _from_file, "http": _from_url, "https": _from_url, "v4l2": _from_device}


def jpeg_size(data: bytes) -> tuple[int, int]:
    """Return width and height of a JPEG picture, pixels; raises Refused for any other data."""
    at = 2
    if data[:2] != bytes((0xFF, _START)):
        raise Refused("the camera did not give a JPEG picture")
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _SIZES:
            return int.from_bytes(data[at + 7 : at + 9]), int.from_bytes(data[at + 5 : at + 7])
        if marker == _SCAN:
            break
        at += 2 if marker in _BARE else 2 + int.from_bytes(data[at + 2 : at + 4])
    raise Refused("the camera's JPEG picture contains no size")
