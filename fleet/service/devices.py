"""The devices in a fleet file, and the permissions for a service to open them; pure.

A USB device gets another number each time it is plugged in, so the unit allows its class, and the udev rule
gives this one device to the group of the service. Together they allow only the named devices.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

import msgspec

from fleet.config.load import Loaded
from fleet.config.text import texts_in

_FILE = re.compile(r"^(?:[a-z0-9]+:)*(/dev/[^?\s]+)")
_INTERFACE = re.compile(r"^can:socketcan:([A-Za-z0-9_.-]{1,15})(?:[?].*)?$")
_UNSAFE = re.compile(r'["\\\n*?\[\]|]')  # characters that end, escape or widen a value of a udev rule
_USB_SERIAL = ("char-ttyUSB", "char-ttyACM")
_CLASSES = (
    ("/dev/ttyUSB", ("char-ttyUSB",)),
    ("/dev/ttyACM", ("char-ttyACM",)),
    ("/dev/ttyAMA", ("char-ttyAMA",)),
    ("/dev/ttyTHS", ("char-ttyTHS",)),
    ("/dev/ttyS", ("char-ttyS",)),
    ("/dev/gpiochip", ("char-gpiochip",)),
    ("/dev/hidraw", ("char-hidraw",)),
    ("/dev/video", ("char-video4linux",)),
    ("/dev/v4l/", ("char-video4linux",)),
)
"""Prefixes of device names with their groups in /proc/devices; other names are USB serial ports."""


class Devices(msgspec.Struct, frozen=True):
    """Devices of robots and stop inputs on one computer: ``files`` in /dev, and SocketCAN ``interfaces``."""

    files: tuple[str, ...] = ()
    interfaces: tuple[str, ...] = ()

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes of devices for the unit's DeviceAllow=."""
        return tuple(sorted({each for file in self.files for each in _classes(file)}))


def devices_of(loaded: Loaded) -> Devices:
    """Return the devices that this computer opens, without those of workers on other computers."""
    here = (
        loaded.given[robot.name]
        for robot, _ in loaded.robots
        if robot.worker not in loaded.config.remote_workers
    )
    texts = [text for given in here for text in texts_in(json.loads(given))]
    texts += [each.device for each in loaded.config.stop_inputs]
    return named_in(texts)


def named_in(texts: Iterable[str]) -> Devices:
    """Return the devices in links and other texts of fleet.yaml."""
    files, interfaces = set(), set()
    for text in texts:
        if found := _FILE.match(text):
            files.add(found[1])
        if found := _INTERFACE.match(text):
            interfaces.add(found[1])
    return Devices(tuple(sorted(files)), tuple(sorted(interfaces)))


def _classes(file: str) -> tuple[str, ...]:
    """Return the possible classes of a device."""
    return next((classes for start, classes in _CLASSES if file.startswith(start)), _USB_SERIAL)


def unsafe_names(devices: Devices) -> list[str]:
    """Return the names of devices that cannot be written in a udev rule."""
    return [file for file in devices.files if _UNSAFE.search(file)]


def udev_rules(devices: Devices, group: str) -> str:
    """Return the rules that give exactly these devices to a group; empty without devices.

    A name is matched as the kernel's own and as a link made by an earlier rule (/dev/serial/by-id). The queue
    of a CAN interface is kept short: frames that wait in it while motor power is off are sent when power
    returns.
    """
    give = f'GROUP="{group}", MODE="0660"'
    lines = []
    for file in devices.files:
        name = file.removeprefix("/dev/")
        lines.append(f'SYMLINK=="{name}", {give}')
        if "/" not in name:
            lines.append(f'KERNEL=="{name}", {give}')
    lines += [
        f'SUBSYSTEM=="net", ACTION=="add", KERNEL=="{interface}", ATTR{{tx_queue_len}}="16"'
        for interface in devices.interfaces
    ]
    return "".join(f"{line}\n" for line in lines)
