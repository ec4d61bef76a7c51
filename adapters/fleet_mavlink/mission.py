"""Missions flown from the autopilot's memory: converted to items, uploaded, started and followed."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Mapping, Sequence

import msgspec

from fleet import (
    CommandError,
    FlyMission,
    GeoOrigin,
    GeoPoint,
    Limits,
    NotReady,
    PlanItem,
    Progress,
    Refused,
    world_from_geo,
)
from fleet_mavlink.command_queue import Superseded
from fleet_mavlink.constants import MavCmd, MavFrame
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.flight import Flight
from fleet_mavlink.messages import CommandLong, MissionCurrent, MissionItemReached
from fleet_mavlink.mission_messages import MissionItemInt
from fleet_mavlink.plans import Plans, PlanType
from fleet_mavlink.preconditions import home_unknown, require_control, require_has
from fleet_mavlink.takeoff import TakeOff
from fleet_mavlink.wings import Winged

_POLL_INTERVAL = 0.5  # s
_LOWEST_TAKEOFF = 2.5  # m
_ELSEWHERE = 1000.0  # m between planned and real home; beyond it the plan is for another place
_OTHER_GROUND = 50.0  # m, likewise for their altitudes
_CLOSE = 2.0  # m

_COMMANDS: Mapping[str, MavCmd] = {
    "waypoint": MavCmd.NAV_WAYPOINT,
    "loiter_unlimited": MavCmd.NAV_LOITER_UNLIM,
    "loiter_turns": MavCmd.NAV_LOITER_TURNS,
    "loiter_time": MavCmd.NAV_LOITER_TIME,
    "loiter_to_altitude": MavCmd.NAV_LOITER_TO_ALT,
    "land": MavCmd.NAV_LAND,
    "return_to_launch": MavCmd.NAV_RETURN_TO_LAUNCH,
    "land_start": MavCmd.DO_LAND_START,
}


_ItemMessage = MissionCurrent | MissionItemReached
_ITEM_MESSAGES: tuple[type[_ItemMessage], ...] = (MissionCurrent, MissionItemReached)


class MissionPlan(msgspec.Struct, frozen=True):
    """Items of a mission for one autopilot; ``steps``: index of the mission's item for each of them."""

    items: tuple[MissionItemInt, ...]
    steps: tuple[int, ...]


def plan_of(
    mission: FlyMission, flavour: Flavour, home: GeoPoint, fastest: float, first: float = math.inf
) -> MissionPlan:
    """Return the items of a mission; ``home`` with its altitude AMSL, ``fastest`` in m/s.

    ``first``: speed of the first item if the mission sets none.
    """
    items: list[MissionItemInt] = []
    steps: list[int] = []
    if flavour.home_is_first:
        items.append(_placed(MissionItemInt(0, 0, 0, MavFrame.GLOBAL, MavCmd.NAV_WAYPOINT), home))
        steps.append(0)
    speed = min(fastest, mission.constraints.max_speed or first)
    for step, item in enumerate(mission.items):
        wanted = speed if item.speed is None else min(fastest, item.speed)
        if math.isfinite(wanted) and (item.speed is not None or step == 0):
            items.append(_speed(wanted, flavour))
            steps.append(step)
        items.append(_item(item, flavour, above_sea=mission.above_sea))
        steps.append(step)
    return MissionPlan(tuple(items), tuple(steps))


def _speed(speed: float, flavour: Flavour) -> MissionItemInt:
    """Return the item that sets the speed from here on."""
    return MissionItemInt(
        0,
        0,
        0,
        MavFrame.MISSION,
        MavCmd.DO_CHANGE_SPEED,
        param1=flavour.speed_kind,
        param2=speed,
        param3=-1.0,
    )


def _item(item: PlanItem, flavour: Flavour, *, above_sea: bool) -> MissionItemInt:
    """Return one item; ``param4`` is a heading, which is left to the autopilot."""
    frame = MavFrame.GLOBAL_INT if above_sea else MavFrame.GLOBAL_RELATIVE_ALT_INT
    radius = (item.radius or 0.0) * (1.0 if item.clockwise else -1.0)
    command = MavCmd.NAV_VTOL_LAND if item.kind == "land" and flavour.transitions else _COMMANDS[item.kind]
    made = MissionItemInt(0, 0, 0, frame, command, param4=flavour.unset)
    match item.kind:
        case "waypoint":
            made = msgspec.structs.replace(made, param2=item.tolerance or 0.0)
        case "loiter_time":
            made = msgspec.structs.replace(made, param1=item.seconds)
        case "loiter_turns":
            made = msgspec.structs.replace(made, param1=float(item.turns), param3=radius)
        case "loiter_unlimited":
            made = msgspec.structs.replace(made, param3=radius)
        case "loiter_to_altitude":
            made = msgspec.structs.replace(made, param1=1.0, param2=radius)
        case "land":
            pass
        case _:
            made = msgspec.structs.replace(made, frame=MavFrame.MISSION, param4=0.0)
    return made if item.point is None else _placed(made, item.point)


def _placed(item: MissionItemInt, point: GeoPoint) -> MissionItemInt:
    """Return an item at a position; its altitude is relative to its frame."""
    x, y = round(point.latitude * 1e7), round(point.longitude * 1e7)
    return msgspec.structs.replace(item, x=x, y=y, z=point.altitude)


def is_same(sent: Sequence[MissionItemInt], kept: Sequence[MissionItemInt], *, skip: int = 0) -> bool:
    """Return True if a vehicle stores the items that were sent; ``skip``: number of its own items.

    Frames are returned as their older equivalents, and altitudes rounded to the centimetre.
    """
    return len(sent) == len(kept) and all(
        one.command == other.command
        and abs(one.x - other.x) <= 1
        and abs(one.y - other.y) <= 1
        and math.isclose(one.z, other.z, abs_tol=0.02)
        for one, other in list(zip(sent, kept, strict=True))[skip:]
    )


class MissionExecutor:
    """Flies missions with one vehicle."""

    def __init__(self, flight: Flight, takeoff: TakeOff, plans: Plans, limits: Limits) -> None:
        self._flight = flight
        self._takeoff = takeoff
        self._plans = plans
        self._limits = limits
        self._vehicle = flight.vehicle
        self._kept: tuple[PlanItem, ...] = ()  # of the last mission that the autopilot was seen to have

    async def fly(self, mission: FlyMission) -> AsyncIterator[Progress]:
        """Upload a mission and fly it to its end, or resume it; everything is checked before the upload."""
        require_has(self._vehicle, "plan")
        require_control(self._vehicle, self._flight.authority)
        if mission.resumed and mission.items != self._kept:  # it was interrupted before it was sent
            mission = msgspec.structs.replace(mission, resumed=False)
        flavour = self._flight.flavour
        home = self._home(mission)
        plan = plan_of(mission, flavour, home, *self._speeds(mission))
        self._require_landing(mission)
        for item in mission.items:
            self._require_reachable(item, mission, home)
        surface = flavour.surface
        moves = self._vehicle.state.armed if surface else self._vehicle.state.in_air
        if moves and not mission.resumed:
            # Hold first: the old target is obsolete, and a mission must not be replaced while it is flown.
            self._flight.end_stream(flavour, flavour.hold)
            await self._flight.hold()
        await self._load(plan, flavour, resumed=mission.resumed)
        self._kept = mission.items
        yield Progress(0.0, "the autopilot has it")
        if surface:
            await self._flight.arming.arm()
        elif not self._vehicle.state.in_air:
            height = next(item.point.altitude for item in mission.items if item.point and item.kind != "land")
            height -= home.altitude if mission.above_sea else 0.0
            async for progress in self._takeoff.climb(max(_LOWEST_TAKEOFF, flavour.lowest, height)):
                yield Progress(0.0, progress.message)
        try:
            async for progress in self._watch(mission, plan):
                yield progress
        except CommandError:
            await self._flight.hold_if_ours()
            raise

    def _speeds(self, mission: FlyMission) -> tuple[float, float]:
        """Return the maximum speed, and the default of the first item; raises like ``Winged.airspeed``."""
        limit, flavour, state = self._limits.speed, self._flight.flavour, self._vehicle.state
        flavour = flavour.forward or flavour
        if not isinstance(flavour, Winged):
            return limit or math.inf, math.inf
        for wanted in (mission.constraints.max_speed, *(item.speed for item in mission.items)):
            flavour.airspeed(state, limit, wanted)
        return flavour.airspeed(state, limit, math.inf), flavour.airspeed(state, limit, None)

    async def clear(self) -> None:
        """Delete the autopilot's mission; raises Refused while ArduPilot flies it."""
        await self._plans.clear(PlanType.MISSION)

    async def _load(self, plan: MissionPlan, flavour: Flavour, *, resumed: bool) -> None:
        """Upload a mission and verify it; a resumed one must already be there."""
        if not resumed:
            self._kept = ()
            await self._plans.upload(PlanType.MISSION, plan.items)
        kept = await self._plans.download(PlanType.MISSION)
        if not is_same(plan.items, kept, skip=int(flavour.home_is_first)):
            what = (
                "the mission was replaced meanwhile" if resumed else "it keeps another mission than was sent"
            )
            raise Refused(what, hint="start the mission anew")

    async def _watch(self, mission: FlyMission, plan: MissionPlan) -> AsyncIterator[Progress]:
        """Start or resume the mission, and follow its items to the end.

        Only messages after the start count: before it both autopilots still report the previous mission.
        """
        flight, flavour = self._flight, self._flight.flavour
        # A rover that has returned stays armed, and in its mission; a plane circles over its home.
        home_last, lands = mission.items[-1].kind == "return_to_launch", _lands(mission)
        returns = lands or (home_last and not flavour.hovers_at_home)
        circles = home_last and flavour.wings and not returns
        ends = (flavour.return_home,) if returns or circles else (flavour.hold, *flavour.mission_ends)
        self._flight.end_stream(flavour, flavour.mission)
        if flavour.rewind is not None and not mission.resumed:
            await flight.commander.request(flavour.rewind)
        before = self._vehicle.state.mission_reached if flavour.repeats_reached else None
        watch = _ItemProgress(plan, len(mission.items), before)
        with self._vehicle.hearing(*_ITEM_MESSAGES) as heard:
            await self._start(flavour, resumed=mission.resumed)
            while not self._is_over(mission, watch, returns=returns):
                watch.observe(await heard.next(_POLL_INTERVAL))
                may_end = self._may_end(mission, watch, returns=returns)
                if may_end:
                    flight.authority.expect_also(*ends)
                if not (returns and self._is_down(mission)):
                    flight.check(flavour.mission, *(ends if may_end else ()))
                if lands and watch.on_last:
                    flight.descent = flavour.mission  # its landing is not aborted without a request
                yield watch.progress()
        if lands:
            flight.descent = ""
        elif not returns and not circles:
            await flight.hold()

    async def _start(self, flavour: Flavour, *, resumed: bool) -> None:
        """Start or resume; repeated while the autopilot may not have checked the mission yet."""
        flight, vehicle = self._flight, self._vehicle
        by = vehicle.now() + flavour.checks_mission
        while True:
            try:
                await flight.enter(flavour.mission, None if resumed else CommandLong(MavCmd.MISSION_START))
            except Superseded:
                raise
            except Refused:
                if resumed or vehicle.now() >= by:
                    raise
                await asyncio.sleep(_POLL_INTERVAL)
            else:
                return

    def _is_over(self, mission: FlyMission, watch: _ItemProgress, *, returns: bool) -> bool:
        """Return True once the mission has ended: on the ground, at its last position, or after all items."""
        state = self._vehicle.state
        if returns:
            return watch.on_last and self._is_down(mission)
        if mission.items[-1].kind == "loiter_unlimited":
            point = mission.items[-1].point
            near = self._around + (mission.items[-1].radius or 0.0)
            return watch.on_last and point is not None and self._away(point) <= near
        flavour, mode = self._flight.flavour, self._flight.mode(state)
        if mission.items[-1].kind == "return_to_launch" and flavour.wings:
            return watch.on_last and mode == flavour.return_home
        held = mode == flavour.hold
        return self._may_end(mission, watch, returns=returns) and (watch.finished or held)

    def _is_down(self, mission: FlyMission) -> bool:
        """Return True once its motors are off; with a planned landing, unless it is reported in the air."""
        state = self._vehicle.state
        return not state.armed and not (_lands(mission) and state.in_air)

    def _may_end(self, mission: FlyMission, watch: _ItemProgress, *, returns: bool) -> bool:
        """Return True once the vehicle may leave the mission by itself: at the last item and its position."""
        last = mission.items[-1]
        if returns or last.point is None:
            return watch.on_last
        near = self._flight.flavour.passes + (last.tolerance or last.radius or 0.0)
        return watch.on_last and self._away(last.point) <= near

    @property
    def _around(self) -> float:
        """Largest distance from a position at which it counts as staying there, m."""
        flavour = self._flight.flavour
        flies = flavour.forward or flavour
        return flies.reach(self._vehicle.state) if isinstance(flies, Winged) else _CLOSE

    def _away(self, point: GeoPoint) -> float:
        """Return the ground distance to a position, m; infinite while its own is unknown."""
        here = self._vehicle.state.position
        if here is None:
            return math.inf
        return world_from_geo(GeoOrigin(here.latitude, here.longitude), point).horizontal()

    def _home(self, mission: FlyMission) -> GeoPoint:
        """Return home with its altitude; raises Refused if the mission was planned for another place."""
        state = self._vehicle.state
        if state.home is None or state.home_altitude is None:
            raise home_unknown()
        home = GeoPoint(state.home.latitude, state.home.longitude, state.home_altitude)
        if mission.home is None:
            return home
        offset = world_from_geo(GeoOrigin(home.latitude, home.longitude, home.altitude), mission.home)
        other_ground = abs(offset.z) > _OTHER_GROUND and not state.on_the_surface
        if offset.horizontal() > _ELSEWHERE or other_ground:
            raise Refused(
                f"the mission is planned from a home {offset.horizontal():.0f} m away and "
                f"{offset.z:+.0f} m higher than this one",
                hint="plan it for this place",
            )
        return home

    def _require_landing(self, mission: FlyMission) -> None:
        """Raise Refused for a landing that this vehicle cannot fly, or without a position before it."""
        if not _lands(mission):
            return
        flavour = self._flight.flavour
        if flavour.surface:
            raise Refused("it does not land: it moves on the surface", hint="end it with return_to_launch")
        if isinstance(flavour, Winged) and self._vehicle.state.vtol_state is None:
            raise NotReady("it has not reported whether it lands with rotors", hint="try again in a second")
        if not any(item.point and item.kind != "land" for item in mission.items):
            raise Refused("a landing must have a place before it, from which it is flown to")

    def _require_reachable(self, item: PlanItem, mission: FlyMission, home: GeoPoint) -> None:
        """Raise Refused for an item beyond the limits."""
        if item.point is None:
            return
        if item.kind != "land":
            self._flight.require_altitude(item.point.altitude + (0.0 if mission.above_sea else home.altitude))
        self._flight.require_distance(item.point)


def _lands(mission: FlyMission) -> bool:
    """Return True if a mission ends with a landing."""
    return mission.items[-1].kind == "land"


class _ItemProgress:
    """Progress of a mission, from the vehicle's active and reached items.

    ``before``: reached item of the previous mission, which is still reported for a while.
    """

    def __init__(self, plan: MissionPlan, count: int, before: int | None) -> None:
        self._before = before
        self._plan = plan
        self._count = count
        self._done = 0  # completed items of the mission

    @property
    def on_last(self) -> bool:
        """True from the last item on."""
        return self._done >= self._count - 1

    @property
    def finished(self) -> bool:
        """True once the last item was reached."""
        return self._done >= self._count

    def observe(self, said: _ItemMessage | None) -> None:
        """Process the number of the active item, or of a reached one, in the vehicle's numbering."""
        if said is None or not 0 <= said.seq < len(self._plan.steps):
            return
        step = self._plan.steps[said.seq]
        if isinstance(said, MissionCurrent):
            self._done = max(self._done, step)
            if self._before is not None and said.seq >= self._before:
                self._before = None
        elif said.seq != self._before and self._ends_step(said.seq):
            self._done = max(self._done, step + 1)

    def _ends_step(self, seq: int) -> bool:
        """Return True if a vehicle's item is the last one for an item of the mission; home is not."""
        steps = self._plan.steps
        own_home = seq == 0 and len(steps) > 1 and self._plan.items[0].frame == MavFrame.GLOBAL
        return not own_home and (seq + 1 == len(steps) or steps[seq + 1] != steps[seq])

    def progress(self) -> Progress:
        """Return the progress."""
        at = min(self._done + 1, self._count)
        percent = min(99.0, 100.0 * self._done / self._count)
        return Progress(percent, f"item {at} of {self._count}", reached=self._done)
