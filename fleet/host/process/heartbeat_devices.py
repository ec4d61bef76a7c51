"""Devices of stop inputs: a serial line, a GPIO line, a HID device. Linux only.

Each row of ``KINDS`` opens one kind. Any data read afterwards are the heartbeat: bytes of a serial line,
rising edges of a GPIO line (GPIO character device v2, <linux/gpio.h>), reports of a HID device
(<linux/hidraw.h>). Older data are discarded. Each function raises OSError with the reason.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
import tty
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fleet.config.schema import StopInputConfig

GET_LINE = 0xC250B407  # GPIO_V2_GET_LINE_IOCTL: _IOWR(0xB4, 7, struct gpio_v2_line_request)
LINE_REQUEST = struct.Struct("=64I32sQI20x240xII20xi")  # offsets, consumer, config, num_lines, buffer, fd
PULSES = 1 << 2 | 1 << 4 | 1 << 9  # input, rising edges, pull-down: a cut wire gives no edges
HID_DESCRIPTOR_SIZE = 0x80044801  # HIDIOCGRDESCSIZE: _IOR('H', 1, int); only hidraw devices support it


def open_device(config: StopInputConfig) -> int:
    """Return a non-blocking descriptor from which the heartbeat is read; raises OSError with the reason."""
    return KINDS[config.kind](config)


def _open_serial(config: StopInputConfig) -> int:
    """Open a serial line exclusively, raw, 8N1."""
    line = _open(config.device)
    try:
        _require(os.isatty(line), "this is not a serial device")
        fcntl.ioctl(line, termios.TIOCEXCL)
        tty.setraw(line)
        settings = termios.tcgetattr(line)
        settings[2] = (settings[2] | termios.CLOCAL | termios.CREAD) & ~termios.HUPCL
        settings[4] = settings[5] = getattr(termios, f"B{config.baud}")
        termios.tcsetattr(line, termios.TCSANOW, settings)
        termios.tcflush(line, termios.TCIFLUSH)
    except termios.error as error:
        os.close(line)
        raise OSError(*error.args) from None
    except OSError:
        os.close(line)
        raise
    return line


def _open_gpio(config: StopInputConfig) -> int:
    """Request one line of a GPIO chip; each event that is read has 48 bytes."""
    chip = _open(config.device)
    try:
        offsets = [config.line or 0, *[0] * 63]
        request = bytearray(LINE_REQUEST.pack(*offsets, b"fleet stop input", PULSES, 0, 1, 0, 0))
        fcntl.ioctl(chip, GET_LINE, request)
    finally:
        os.close(chip)
    line: int = LINE_REQUEST.unpack(request)[-1]
    os.set_blocking(line, False)
    return line


def _open_hid(config: StopInputConfig) -> int:
    """Open a HID device; it must send reports repeatedly by itself."""
    device = _open(config.device)
    try:
        fcntl.ioctl(device, HID_DESCRIPTOR_SIZE, bytearray(4))
    except OSError:
        os.close(device)
        raise OSError(errno.ENOTTY, "this is not a HID device (/dev/hidrawN)") from None
    return device


def _require(condition: bool, otherwise: str) -> None:  # noqa: FBT001 - reads as a sentence
    """Raise OSError unless the condition holds."""
    if not condition:
        raise OSError(errno.ENOTTY, otherwise)


def _open(path: str) -> int:
    """Open a device for reading, without blocking."""
    return os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)


KINDS: Mapping[str, Callable[[StopInputConfig], int]] = MappingProxyType(
    {"serial": _open_serial, "gpio": _open_gpio, "hid": _open_hid}
)
