"""Serial lines (Linux), through the optional package serialx."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import functools
from typing import TYPE_CHECKING, Any

from fleet.errors import LinkError, LinkLost, LinkRefused
from fleet.link.base import Receiver
from fleet.link.stream import StreamLink

if TYPE_CHECKING:
    import serialx

_BACKLOG = 0.5  # s of line time that may be unsent: at 10 bits a byte, a line sends baud / 10 bytes a second
_SMALLEST_BACKLOG = 512  # bytes, so that a slow line still accepts one long frame


async def open_serial(url: str, path: str, baud: int, receiver: Receiver) -> StreamLink:
    """Open a serial device exclusively, without touching DTR and RTS (they reset many boards).

    Raises LinkLost while the device is not plugged in; LinkRefused without permission, when another
    program has the device open, when it is not a serial device, or without the extra ``serial``.
    """
    try:
        serialx = await asyncio.to_thread(_library)  # its first import would block the loop for too long
    except ImportError:
        raise LinkRefused(f"{url}: serial lines need an extra: pip install 'zenoh-fleet[serial]'") from None
    untouched = serialx.PinState.UNDEFINED
    port = serialx.serial_for_url(
        path,
        baud,
        exclusive=True,
        dtr_on_open=untouched,
        rts_on_open=untouched,
        dtr_on_close=untouched,
        rts_on_close=untouched,
    )
    try:
        await asyncio.to_thread(port.open)
    except OSError as error:
        raise _why_unopened(url, error) from None
    except (serialx.SerialException, ValueError, OverflowError) as error:
        raise LinkRefused(f"{url}: {error}") from None
    return StreamLink(
        url,
        port.fileno(),
        receiver,
        backlog=max(_SMALLEST_BACKLOG, int(baud / 10 * _BACKLOG)),
        close_descriptor=functools.partial(_close, port),
    )


def _library() -> Any:
    """Return the module serialx; raises ImportError without the extra."""
    import serialx  # noqa: PLC0415 - an optional extra

    return serialx


def _close(port: serialx.Serial, throw_away: bool) -> None:  # noqa: FBT001 - called by StreamLink only
    """Close the port. The kernel waits for unsent bytes, so those of a dead line are discarded first."""
    if throw_away:
        with contextlib.suppress(OSError):  # an unplugged device has no buffer to discard
            port.reset_write_buffer()
    port.close()


_REFUSED = {
    errno.EACCES: "no permission; add this user to the device's group (often dialout) and log in again",
    errno.EBUSY: "another program has it open; stop that program",
    errno.ENOTTY: "this is not a serial device",
    errno.EISDIR: "this is a folder, not a device",
}


def _why_unopened(url: str, error: OSError) -> LinkError:
    """Return the error for a device that cannot be opened, with the reason and the remedy."""
    if error.errno in _REFUSED:
        return LinkRefused(f"{url}: {_REFUSED[error.errno]}")
    return LinkLost(f"{url}: {error.strerror or error}; is it plugged in?")
