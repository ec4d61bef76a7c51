"""What every autopilot is flown through: simulated ones in each run of the tests, real ones by address.

A step is a coroutine that takes ``it``: the adapter on a link (``do``, ``drive``, ``until``, ``state``,
``robot``). It fails by raising. The list is safe for a simulator; it is not meant for an aircraft in a room.
"""

from __future__ import annotations

import asyncio

import pytest

from fleet import Goal, GoTo, TimedOut, Vector3, Velocity
from fleet.errors import CommandError
from fleet.model.report import FlightControllerReport, GpsReport, ImuReport, PoseReport

HEIGHT = 6.0  # m
LONG = 240.0  # s
OUR_PARAMETER = {"ardupilot": "RTL_LOIT_TIME", "px4": "MIS_TAKEOFF_ALT"}


def flavour(it):
    """Return the name of the autopilot."""
    return it.adapter._session.flight.flavour.name


async def meets(it):
    """Hear it, and let it tell where it is."""
    await it.until(lambda: it.adapter._session and it.state.home_altitude is not None, LONG)
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


async def takes_off(it):
    """Climb to the height above home."""
    await it.do("takeoff", altitude=HEIGHT)
    assert abs(it.state.relative_altitude - HEIGHT) < 1.0


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
    takes_off,
    moves_and_holds,
    strafes_without_turning,
    goes_to_a_place,
    climbs_and_sinks,
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
            for said in list(it.adapter._session.vehicle.sentences)[-10:] if it.adapter._session else ():
                note(f"    it said: {said.text}")
            raise
        note(f"ok     {step.__name__} {loop.time() - began:.1f} s")
