"""Uploads the fence of fleet.yaml to the autopilot, so that it holds without the edge.

Polygons are sent with the mission protocol and verified by reading back; height, distance and the action at
the border are parameters. A fence is uploaded on the ground only; in flight it is compared, and differences
are reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from fleet import CommandError, FenceConfig, GeoOrigin, GeoPoint, Limits, Refused, Vector3, geo_from_world
from fleet_mavlink.constants import MavCmd, MavFrame
from fleet_mavlink.mission import is_same
from fleet_mavlink.mission_messages import MissionItemInt
from fleet_mavlink.parameters import Parameters, same
from fleet_mavlink.plans import Plans, PlanType
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_FOREVER = 3600.0  # s between checks when nothing happens
_AGAIN = 10.0  # s until a failed upload is tried again
_WIDER = 2.0  # m by which the autopilot's limits are wider, so that the host reacts first
_HEIGHT, _CIRCLE, _POLYGON = 1, 2, 4  # bits of FENCE_TYPE
_UNION = 2  # FENCE_OPTIONS: being inside any inclusion is enough


def items_of(fence: FenceConfig, world: GeoOrigin) -> tuple[MissionItemInt, ...]:
    """Return the vertices of a fence as mission items; each has the number of vertices of its polygon."""
    inside = _corners(fence, fence.inclusion, MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION, world)
    outside = _corners(fence, fence.exclusion, MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION, world)
    return (*inside, *outside)


def _corners(
    fence: FenceConfig,
    polygons: Iterable[tuple[tuple[float, float], ...]],
    command: MavCmd,
    world: GeoOrigin,
) -> Iterable[MissionItemInt]:
    """Yield the vertices of polygons of one kind."""
    for polygon in polygons:
        for corner in polygon:
            point = GeoPoint(*corner)
            if fence.frame == "world":
                point = geo_from_world(world, Vector3(*corner, 0.0))
            x, y = round(point.latitude * 1e7), round(point.longitude * 1e7)
            yield MissionItemInt(0, 0, 0, MavFrame.GLOBAL, command, param1=float(len(polygon)), x=x, y=y)


def parameters_of(flavour: str, fence: FenceConfig, limits: Limits) -> Mapping[str, float]:
    """Return the parameters that enable a fence; at its border the vehicle returns home."""
    polygons = bool(fence.inclusion or fence.exclusion)
    height = 0.0 if limits.altitude is None else limits.altitude + _WIDER
    radius = 0.0 if limits.distance is None else limits.distance + _WIDER
    if flavour == "px4":
        return {"GF_MAX_HOR_DIST": radius, "GF_MAX_VER_DIST": height, "GF_ACTION": 3}
    kinds = _POLYGON * polygons + _HEIGHT * bool(height)
    kinds += _CIRCLE * bool(radius)
    wanted: dict[str, float] = {"FENCE_TYPE": kinds, "FENCE_ACTION": 1, "FENCE_OPTIONS": _UNION}
    if height:
        wanted["FENCE_ALT_MAX"] = height
    if radius:
        wanted["FENCE_RADIUS"] = radius
    return {**wanted, "FENCE_ENABLE": 1}


class FenceUploader:
    """Maintains the fence on one vehicle; ``troubles``: why it is not uploaded, empty once it is."""

    def __init__(
        self,
        vehicle: Vehicle,
        plans: Plans,
        parameters: Parameters,
        *,
        fence: FenceConfig,
        limits: Limits,
        origin: Callable[[], GeoOrigin | None],
        changed: Callable[[], None],
    ) -> None:
        self.troubles: tuple[str, ...] = ()
        self._vehicle = vehicle
        self._plans = plans
        self._parameters = parameters
        self._fence = fence
        self._limits = limits
        self._origin = origin
        self._changed = changed

    async def run(self) -> None:
        """Upload the fence at each connect and after each reboot, until cancelled."""
        self._report("the fence is not in the autopilot yet")
        while True:
            await self._vehicle.until(self._is_met, _FOREVER)
            reboots = self._vehicle.state.reboots
            wait = _FOREVER
            try:
                await self._bring()
                self._report("")
            except CommandError as error:
                wait = _AGAIN
                self._report(f"the fence is not in the autopilot: {error.reason}")
            await self._vehicle.restarted(reboots, wait)

    def _is_met(self, _state: VehicleState) -> bool:
        """Return True once the vehicle answers and enough is known of it to upload a fence."""
        known = self._vehicle.flavour is not None and self._origin() is not None
        return self._vehicle.connected and known

    async def _bring(self) -> None:
        """Make the vehicle's fence that of fleet.yaml; raises like the exchanges with the vehicle."""
        world, flavour = self._origin(), self._vehicle.flavour
        if world is None or flavour is None:
            return
        items = items_of(self._fence, world)
        if not is_same(items, await self._plans.download(PlanType.FENCE)):
            await self._landed()
            await self._plans.upload(PlanType.FENCE, items)
            if not is_same(items, await self._plans.download(PlanType.FENCE)):
                raise Refused("it keeps another one than was sent")
        limits = self._limits.model_copy(update={"altitude": None}) if flavour.surface else self._limits
        for name, value in parameters_of(flavour.name, self._fence, limits).items():
            (kept,) = await self._parameters.read([name])
            if not same(kept.value, value):
                await self._landed()
                await self._parameters.write(name, value)
        self._vehicle.log.info("it has its fence of %d corners", len(items))

    async def _landed(self) -> None:
        """Wait until the motors are off."""
        if self._vehicle.state.armed:
            self._report("the autopilot has another fence, which is not changed in flight")
            await self._vehicle.until(lambda state: not state.armed, _FOREVER)

    def _report(self, trouble: str) -> None:
        """Store the problem, and report it if it has changed."""
        before, self.troubles = self.troubles, (trouble,) if trouble else ()
        if before != self.troubles:
            self._changed()
