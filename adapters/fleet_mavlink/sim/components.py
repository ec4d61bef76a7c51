"""Components beside the simulated autopilot on its link: gimbal, ADS-B receiver, camera, Remote ID."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.command_request import ACCEPTED, UNSUPPORTED, decode_request, whole
from fleet_mavlink.sim.gimbal import DEVICE, SimGimbal
from fleet_mavlink.sim.remote_id import SimRemoteId
from fleet_mavlink.sim.vehicle import SimVehicle

_CAMERA = 100
_EXPOSURE = 0.4  # s from the command to the picture


def framed(packer: Any, messages: Iterable[Any]) -> list[bytes]:
    """Return the frames of messages; the packer numbers them, like pymavlink's own ``send``."""
    frames = []
    for message in messages:
        frames.append(bytes(message.pack(packer)))
        packer.seq = (packer.seq + 1) & 0xFF
    return frames


class Component:
    """A component that only reports its presence: HEARTBEAT at 1 Hz."""

    component = 156
    kind = int(mav.MAV_TYPE_ADSB)

    def __init__(self, vehicle: SimVehicle) -> None:
        self._vehicle = vehicle
        self._packer = mav.MAVLink(None, srcSystem=vehicle.system_id, srcComponent=self.component)
        self._due = 0.0

    def step(self, now: float) -> list[bytes]:
        """Return the frames that are due."""
        said = self.messages(now)
        if now >= self._due:
            self._due = now + 1.0
            state, invalid = mav.MAV_STATE_ACTIVE, mav.MAV_AUTOPILOT_INVALID
            said.append(mav.MAVLink_heartbeat_message(self.kind, invalid, 0, 0, state, 3))
        return self.framed(said)

    def messages(self, now: float) -> list[object]:  # noqa: ARG002 - for subclasses
        """Return its messages besides its heartbeat."""
        return []

    def requested(self, message: object, now: float) -> list[object] | None:  # noqa: ARG002 - for subclasses
        """Return the answers to a message; None if it is not addressed to the component."""
        return None

    def framed(self, messages: list[object]) -> list[bytes]:
        """Return frames in its name."""
        return framed(self._packer, messages)


class GimbalDevice(Component):
    """The gimbal behind the autopilot's gimbal manager; it reports its attitude."""

    component = DEVICE
    kind = int(mav.MAV_TYPE_GIMBAL)

    def __init__(self, vehicle: SimVehicle) -> None:
        super().__init__(vehicle)
        self._gimbal = vehicle.equipment.gimbal = SimGimbal()

    def messages(self, now: float) -> list[object]:
        """Report its attitude."""
        return self._gimbal.due(now, int(now * 1000))


class SimCamera(Component):
    """A camera with a component of its own; takes a picture a moment after the command."""

    component = _CAMERA
    kind = int(mav.MAV_TYPE_CAMERA)

    def __init__(self, vehicle: SimVehicle) -> None:
        super().__init__(vehicle)
        self._pictures = 0
        self._ready_at: list[float] = []

    def requested(self, message: Any, now: float) -> list[object] | None:
        """Answer IMAGE_START_CAPTURE for one picture; all others are unsupported."""
        if message.get_type() != "COMMAND_LONG" or message.target_component != self.component:
            return None
        request = decode_request(message)
        takes = request.command == mav.MAV_CMD_IMAGE_START_CAPTURE and whole(request.p3) == 1
        if takes:
            self._ready_at.append(now + _EXPOSURE)
        result = ACCEPTED if takes else UNSUPPORTED
        return [
            mav.MAVLink_command_ack_message(request.command, result, 0, 0, request.system, request.component)
        ]

    def messages(self, now: float) -> list[object]:
        """Report the pictures that are taken."""
        taken = [at for at in self._ready_at if at <= now]
        self._ready_at = [at for at in self._ready_at if at > now]
        return [self._picture(now) for _ in taken]

    def _picture(self, now: float) -> object:
        """Return CAMERA_IMAGE_CAPTURED."""
        self._pictures += 1
        latitude, longitude, altitude = self._vehicle.pilot.geo()
        height = self._vehicle.pilot.home.height()
        return mav.MAVLink_camera_image_captured_message(
            int(now * 1000),
            0,
            0,
            int(latitude * 1e7),
            int(longitude * 1e7),
            int(altitude * 1000),
            int(height * 1000),
            [1.0, 0.0, 0.0, 0.0],
            self._pictures,
            0 if "camera_fails" in self._vehicle.faults else 1,
            f"/DCIM/{self._pictures:04d}.jpg".encode(),
        )


class RemoteIdTransmitter(Component):
    """A Remote ID transmitter; sends its arm status once a second, to its autopilot and to all."""

    component = int(mav.MAV_COMP_ID_ODID_TXRX_1)
    kind = int(mav.MAV_TYPE_ODID)

    def __init__(self, vehicle: SimVehicle) -> None:
        super().__init__(vehicle)
        vehicle.equipment.remote_id = SimRemoteId()
        self._reported_at = -math.inf

    def messages(self, now: float) -> list[object]:
        """Send the arm status."""
        known = self._vehicle.equipment.remote_id
        if known is None or now - self._reported_at < 1.0 or "remote_id_silent" in self._vehicle.faults:
            return []
        self._reported_at = now
        missing_data = known.missing_data(now, located=self._vehicle.pilot.home.known)
        bad = mav.MAV_ODID_ARM_STATUS_PRE_ARM_FAIL_GENERIC
        status = bad if missing_data else mav.MAV_ODID_ARM_STATUS_GOOD_TO_ARM
        message = mav.MAVLink_open_drone_id_arm_status_message(status, missing_data.encode())
        known.handle_arm_status(message, now)
        return [message]


ACCESSORIES: Mapping[str, type[Component]] = {
    "gimbal": GimbalDevice,
    "adsb": Component,
    "camera": SimCamera,
    "remote_id": RemoteIdTransmitter,
}
