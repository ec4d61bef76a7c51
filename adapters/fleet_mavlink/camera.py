"""Pictures of a camera component with the MAVLink camera protocol."""

from __future__ import annotations

import msgspec

from fleet import Fault, TimedOut, Unsupported
from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.payload_messages import CameraImageCaptured
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.vehicle import Vehicle, VehicleComponent

_ONE = 1.0  # picture
_TAKEN_WITHIN = 5.0  # s


class Photo(msgspec.Struct, frozen=True):
    """A picture: its number, and its location on the camera."""

    index: int
    url: str


class CameraComponent:
    """Camera of one vehicle, usable once its heartbeat was received."""

    def __init__(self, vehicle: Vehicle, timing: CommandTimeouts) -> None:
        self._vehicle = vehicle
        self._timing = timing
        self._taken = 0
        self._commander: tuple[VehicleComponent, Commander] | None = None

    async def take_photo(self) -> Photo:
        """Take one picture; return once the camera confirms it.

        Raises Unsupported without a camera, Fault if the camera failed, TimedOut if it is silent.
        """
        require_connection(self._vehicle)
        camera = self._vehicle.camera
        if camera is None:
            raise Unsupported("no camera of this vehicle has sent a heartbeat")
        require_connection(camera)
        with camera.hearing(CameraImageCaptured) as heard:
            self._taken += 1
            request = CommandLong(
                MavCmd.IMAGE_START_CAPTURE,
                target_component=camera.component,
                param3=_ONE,
                param4=float(self._taken),
            )
            # Sent only once: a repeat might take a second picture.
            await self._commander_of(camera).request(request, tries=1)
            taken = await heard.next(_TAKEN_WITHIN)
        if taken is None:
            raise TimedOut("the camera accepted the command but reported no picture")
        if taken.capture_result != 1:
            raise Fault("the camera could not take the picture", hint="is its card full?")
        return Photo(taken.image_index, taken.file_url)

    def _commander_of(self, camera: VehicleComponent) -> Commander:
        """Return the commander for this camera component."""
        if self._commander is None or self._commander[0] is not camera:
            self._commander = camera, Commander(camera, self._timing)
        return self._commander[1]
