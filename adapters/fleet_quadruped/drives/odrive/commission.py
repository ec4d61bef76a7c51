"""Checks of ODrives before they may move, and setting of their watchdog, verified by reading back."""

from __future__ import annotations

import logging
import struct
from collections.abc import Sequence

from fleet import CanFrame, LinkRefused
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.axis import OdriveAxis
from fleet_quadruped.drives.odrive.frames import OdriveCommand
from fleet_quadruped.robot.parts import Drive

log = logging.getLogger(__name__)

_ON = struct.pack("<?", True)


def commission(axes: Sequence[OdriveAxis], requester: DriveRequester, drive: Drive) -> None:
    """Check that all drives answer with a supported firmware; set their watchdog.

    Raises LinkLost or LinkRefused.
    """
    for axis in axes:
        axis.restarted, axis.version = False, None
        axis.serials.clear()
        axis.parameters.clear()
    requester.request(
        axes, lambda axis: wire.request(axis.id, OdriveCommand.VERSION), lambda axis: axis.version is not None
    )
    for axis in axes:
        version = axis.version or (0, 0)
        if version < wire.OLDEST:
            version_text = ".".join(map(str, version))
            raise LinkRefused(
                f"{axis.joint.name}: firmware {version_text}, wanted 0.6 or newer (command 00h)"
            )
    requester.request(
        axes, lambda axis: wire.request(axis.id, OdriveCommand.ADDRESS), lambda axis: bool(axis.serials)
    )
    _set_watchdog(axes, requester, drive)


def _set_watchdog(axes: Sequence[OdriveAxis], requester: DriveRequester, drive: Drive) -> None:
    """Set the timeout, enable the watchdog, and verify both."""
    endpoints = drive.endpoints
    if endpoints is None:
        log.warning(
            "ODrive: no drive.endpoints; see in odrivetool that axis0.config.enable_watchdog is true and "
            "watchdog_timeout %g s, or the drives go on when this computer dies",
            drive.timeout,
        )
        return
    timeout = struct.pack("<f", drive.timeout)
    for endpoint, value in ((endpoints.watchdog_timeout, timeout), (endpoints.enable_watchdog, _ON)):
        for axis in axes:
            axis.send(OdriveCommand.PARAMETER, wire.write_parameter(endpoint, value))
        _verify(axes, requester, endpoint, value)


def _verify(axes: Sequence[OdriveAxis], requester: DriveRequester, endpoint: int, wanted: bytes) -> None:
    """Read a parameter of all drives; raises LinkRefused for a different value."""

    def question(axis: OdriveAxis) -> CanFrame:
        return CanFrame(wire.identifier(axis.id, OdriveCommand.PARAMETER), wire.read_parameter(endpoint))

    requester.request(axes, question, lambda axis: endpoint in axis.parameters)
    for axis in axes:
        actual = axis.parameters[endpoint][: len(wanted)]
        if actual != wanted:
            raise LinkRefused(
                f"{axis.joint.name}: parameter {endpoint} (watchdog) is {actual.hex()}, not "
                f"{wanted.hex()}; drive.endpoints must be those of its firmware"
            )
