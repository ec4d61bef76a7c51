"""What every autopilot is flown through: simulated ones in each run of the tests, real ones by address.

A step is a coroutine that takes ``it``: the adapter on a link (``do``, ``drive``, ``until``, ``state``,
``robot``). It fails by raising. The list is safe for a simulator; it is not meant for an aircraft in a room.
"""

from __future__ import annotations

import asyncio
import contextlib
import math

import pytest

from fleet import Goal, GoTo, NotReady, RelativeMove, TimedOut, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.report import FlightControllerReport, GpsReport, ImuReport, PoseReport

HEIGHT = 6.0  # m
HEIGHTS = (2.0, 3.0, 5.0, 12.0)  # m
EXACT = 0.6  # m; a real estimate wanders
HABIT = {"ardupilot": ("WP_YAW_BEHAVIOR", (0, 1, 2)), "px4": ("MPC_YAW_MODE", (0, 1, 4))}
THERE_AND_BACK = (
    Vector3(-5.0, 0.0, 0.0),
    Vector3(5.0, 0.0, 0.0),
    Vector3(0.0, 5.0, 0.0),
    Vector3(0.0, -5.0, 0.0),
    Vector3(-3.0, -3.0, 1.0),
    Vector3(3.0, 3.0, -1.0),
)
LONG = 240.0  # s
OUR_PARAMETER = {"ardupilot": "RTL_LOIT_TIME", "px4": "MIS_TAKEOFF_ALT"}


def flavour(it):
    """Return the name of the autopilot."""
    return it.adapter._session.flight.flavour.name


async def meets(it):
    """Hear it, and let it tell where it is."""
    await it.until(lambda: it.robot.is_connected and it.state.home_altitude is not None, LONG)
    await it.until(lambda: any(isinstance(each, PoseReport) for each in it.robot.reports), LONG)


async def becomes_ready(it):
    """Wait until nothing on the check list stands against a take-off."""
    for _ in range(60):
        answer = await it.do("check_ready")
        if answer["ready"]:
            return
        await asyncio.sleep(2.0)
    raise AssertionError(f"not ready: {[each for each in answer['checks'] if not each['ok']]}")


async def reads_and_writes_a_parameter(it):
    """Give a parameter a value, and its own back."""
    name = OUR_PARAMETER[flavour(it)]
    before = (await it.do("get_parameters", names=[name]))[name]
    assert (await it.do("set_parameter", name=name, value=before + 1))["after"] == before + 1
    assert (await it.do("set_parameter", name=name, value=before))["after"] == before


async def refuses_what_does_not_exist(it):
    """Ask for a parameter that is not there; the refusal says so."""
    with pytest.raises(CommandError, match="no parameter"):
        await it.do("get_parameters", names=["NO_SUCH_ONE"])


def stands_at(it, height):
    """Look whether it is at a height above home."""
    off = it.state.relative_altitude - height
    assert abs(off) < EXACT, f"it is {off:+.2f} m off {height:g} m"


@contextlib.asynccontextmanager
async def begun(doing):
    """Run a command beside the step; the next one takes its place."""
    task = asyncio.ensure_future(doing)
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def takes_off_to_every_height_and_lands(it):
    """Take off to 2, 3, 5 and 12 m, each again as soon as it has landed."""
    for height in HEIGHTS:
        await it.do("takeoff", altitude=height)
        stands_at(it, height)
        await asyncio.sleep(3.0)
        stands_at(it, height)
        await it.do("land")
        assert not it.state.armed


async def takes_off_out_of_a_landing(it):
    """Take off while it comes down: high up, near the ground, on it, and as it switches its motors off."""
    moments = (
        lambda: it.state.relative_altitude < 3.0,
        lambda: it.state.relative_altitude < 1.5,
        lambda: it.state.in_air is False,
    )
    for later, moment in ((0.0, moments[0]), (0.0, moments[1]), (0.0, moments[2]), (1.2, moments[2])):
        await it.do("takeoff", altitude=4.0)
        async with begun(it.do("land")):
            await it.until(moment, LONG)
            await asyncio.sleep(later)
        await it.do("takeoff", altitude=5.0)
        stands_at(it, 5.0)
        await asyncio.sleep(4.0)
        assert it.state.armed
        stands_at(it, 5.0)
    await it.do("land")
    await it.do("takeoff", altitude=3.0)
    await it.do("land")


async def takes_off_twice(it):
    """Ask for a second take-off soon after the first, before and after it is seen to fly."""
    for later in (0.5, 1.5, 2.5, 4.0):
        async with begun(it.do("takeoff", altitude=3.0)):
            await it.until(lambda: it.state.armed, LONG)
            await asyncio.sleep(later)
        await it.do("takeoff", altitude=4.0)
        stands_at(it, 4.0)
        await it.do("land")


async def obeys_the_second_of_two_commands_on_the_ground(it):
    """Ask for something else before the first is seen to begin: its motors do not run on."""
    for first, moment, second in (
        (("arm", {}), 0.1, "disarm"),
        (("arm", {}), 0.1, "land"),
        (("takeoff", {"altitude": HEIGHT}), 0.6, "land"),
        (("takeoff", {"altitude": HEIGHT}), 0.6, "return_to_home"),
        (("takeoff", {"altitude": HEIGHT}), 2.5, "land"),
    ):
        name, data = first
        async with begun(it.do(name, **data)):
            await asyncio.sleep(moment)
        await it.do(second)
        assert not it.state.armed, f"{name}, {second}: it is armed"
        await asyncio.sleep(3.0)
        assert not it.state.armed, f"{name}, {second}: it is armed later"


async def obeys_the_second_of_two_commands_in_the_air(it):
    """Ask for something else before the first is seen to begin: it does not come down, nor fly on."""
    await it.do("takeoff", altitude=HEIGHT)
    for first in ("land", "return_to_home"):
        for moment, second in ((0.3, ("takeoff", {})), (0.1, ("ascend", {"distance": 1.0}))):
            async with begun(it.do(first)):
                await asyncio.sleep(moment)
            name, data = second
            await it.do(name, **data)
            await it.until(lambda: it.state.speed < 0.6, 10.0)
            height = it.state.relative_altitude
            await asyncio.sleep(5.0)
            mode = it.adapter._session.flight.mode(it.state)
            assert it.state.armed, f"{first}, {name}: disarmed"
            assert abs(it.state.relative_altitude - height) < 1.0, f"{first}, {name}: it moves in {mode}"
            assert height > HEIGHT - 2.0, f"{first}, {name}: it came down in {mode}"
    async with begun(flown(it, GoTo(goal=Goal(position=Vector3(0.0, 60.0, HEIGHT))))):
        await it.until(lambda: it.state.speed > 2.0, LONG)
    await it.do("takeoff")
    await it.until(lambda: it.state.speed < 0.6, 10.0)
    await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 1.0)
    await flown(it, GoTo(goal=Goal(position=Vector3(4.0, 4.0, HEIGHT))))
    async with begun(it.do("land")):
        await asyncio.sleep(0.0)
        await it.adapter.stop("stop")
    await asyncio.sleep(3.0)
    await it.until(lambda: it.state.speed < 0.6, 10.0)
    assert it.state.armed
    await it.do("land")


async def takes_no_goal_while_it_takes_off(it):
    """Ask for a goal, and to be armed, during a take-off: the goal is refused, the take-off goes on."""
    async with begun(it.do("takeoff", altitude=HEIGHT)) as rising:
        await it.until(lambda: it.state.armed and it.state.in_air, LONG)
        await it.do("arm")
        with pytest.raises(NotReady):
            await anext(it.adapter.navigate(GoTo(goal=Goal(position=Vector3(5.0, 0.0, HEIGHT)))))
        await rising
    stands_at(it, HEIGHT)


async def moves_there_and_back_without_turning(it):
    """Move by distances along its own axes, whatever its habit of turning is; the nose stays."""
    parameter, habits = HABIT[flavour(it)]
    turned = Goal(position=Vector3(0.0, 0.0, HEIGHT), yaw=math.radians(30.0))
    await flown(it, GoTo(goal=turned))
    await asyncio.sleep(
        3.0
    )  # the turn is done within 0.2 rad, and swings past it: a nose that is to stay rests
    before = (await it.do("get_parameters", names=[parameter]))[parameter]
    try:
        for habit in habits:
            await it.do("set_parameter", name=parameter, value=habit, force=True)
            nose, place = it.state.attitude.yaw, it.state.position
            for step in THERE_AND_BACK:
                most = await flown(it, RelativeMove(step), nose)
                assert most < 0.2, f"{parameter} {habit}: it turned {most:.2f} rad on its way {step}"
            away = math.hypot(
                (it.state.position.latitude - place.latitude) * 111_000,
                (it.state.position.longitude - place.longitude)
                * 111_000
                * math.cos(math.radians(place.latitude)),
            )
            assert away < 1.5, f"it came back {away:.1f} m beside"
    finally:
        await it.do("set_parameter", name=parameter, value=before, force=True)


async def flown(it, task, nose=None):
    """Fly a task; return how far the nose was from ``nose`` at the most."""
    most = 0.0
    async for _ in it.adapter.navigate(task):
        if nose is not None:
            most = max(most, abs(math.remainder(it.state.attitude.yaw - nose, math.tau)))
    return most


async def moves_and_holds(it):
    """Drive it forward; it stands once it is not driven."""
    before = it.state.position
    await it.drive(Velocity(Vector3(1.0, 0.0, 0.0)), 3.0)
    await it.adapter.stop("stop")
    await it.until(lambda: it.state.speed < 0.5, 10.0)
    assert it.state.position != before


async def strafes_without_turning(it):
    """Drive it sideways; it keeps its heading."""
    before = it.state.attitude.yaw
    await it.drive(Velocity(Vector3(0.0, 1.0, 0.0)), 3.0)
    await it.adapter.stop("hover")
    turned = abs((it.state.attitude.yaw - before + 3.14159) % 6.28318 - 3.14159)
    assert turned < 0.3, f"it turned {turned:.2f} rad"


async def goes_to_a_place(it):
    """Send it 8 m east of home at the same height."""
    goal = GoTo(goal=Goal(position=Vector3(8.0, 0.0, HEIGHT)))
    progress = [each async for each in it.adapter.navigate(goal)]
    assert progress[-1].percent == 100.0


async def climbs_and_sinks(it):
    """Climb and sink by a distance."""
    before = it.state.relative_altitude
    await it.do("ascend", distance=3.0)
    assert it.state.relative_altitude > before + 2.0
    await it.do("descend", distance=3.0)


async def is_stopped_though_it_is_not_heard(it):
    """Hear it no more on its way to a place: a plain stop is written all the same, and holds it."""
    session = it.adapter._session
    vehicle, hub = session.vehicle, session._hub
    steps = it.adapter.navigate(GoTo(goal=Goal(position=Vector3(250.0, 0.0, HEIGHT))))
    await anext(steps)
    await it.until(lambda: it.state.speed > 2.0, LONG)
    hub.receive = lambda *_: None
    await it.until(lambda: not vehicle.connected, LONG)
    assert it.adapter.halt_unheard("stop")
    with pytest.raises(NotReady, match="the stop was written"):
        await it.adapter.stop("stop")
    await asyncio.sleep(5.0)
    del hub.receive
    await it.until(lambda: vehicle.connected and it.state.speed < 0.5, 10.0)
    mode, wanted = session.flight.mode(it.state), session.flight.flavour.hold
    assert mode == wanted, f"it is in {mode}"
    await steps.aclose()


async def is_not_disarmed_nor_rebooted_in_the_air(it):
    """Ask for what would let it fall; it is refused."""
    for name, data in (("disarm", {"force": True}), ("reboot", {}), ("kill", {"force": True})):
        with pytest.raises(CommandError):
            await it.do(name, **data)


async def returns_home(it):
    """Send it home; it lands and switches its motors off."""
    await it.do("return_to_home")
    assert not it.state.armed


async def tells_all_of_it(it):
    """Look whether pose, fix, rates and the flight controller were told."""
    for kind in (PoseReport, GpsReport, ImuReport, FlightControllerReport):
        assert any(isinstance(each, kind) for each in it.robot.reports), f"no {kind.__name__}"


async def reads_a_log(it):
    """List the logs and read the first bytes of one; a simulator may have none."""
    try:
        logs = await it.do("list_logs")
    except TimedOut:
        return
    if logs:
        first = await it.do("read_log", id=logs[-1]["id"], count=900)
        assert first["count"] > 0


STEPS = (
    meets,
    becomes_ready,
    reads_and_writes_a_parameter,
    refuses_what_does_not_exist,
    takes_off_to_every_height_and_lands,
    takes_off_out_of_a_landing,
    takes_off_twice,
    obeys_the_second_of_two_commands_on_the_ground,
    obeys_the_second_of_two_commands_in_the_air,
    takes_no_goal_while_it_takes_off,
    moves_there_and_back_without_turning,
    moves_and_holds,
    strafes_without_turning,
    goes_to_a_place,
    climbs_and_sinks,
    is_stopped_though_it_is_not_heard,
    is_not_disarmed_nor_rebooted_in_the_air,
    returns_home,
    tells_all_of_it,
    reads_a_log,
)


async def fly(it, note):
    """Fly the list; ``note(line)`` is told how long each step took, and what the autopilot said."""
    loop = asyncio.get_running_loop()
    for step in STEPS:
        began = loop.time()
        try:
            await step(it)
        except (AssertionError, CommandError, TimeoutError, pytest.fail.Exception) as error:
            note(f"FAILED {step.__name__} after {loop.time() - began:.1f} s: {error}")
            for said in list(it.adapter._session.vehicle.sentences)[-10:] if it.robot.is_connected else ():
                note(f"    it said: {said.text}")
            raise
        note(f"ok     {step.__name__} {loop.time() - began:.1f} s")
