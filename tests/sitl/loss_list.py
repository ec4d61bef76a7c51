"""What a flying multirotor is put through: its satellites, or its battery, are lost.

Parameters of the simulator take them away.
The reason must stand in health and in ``authority_lost``, in the autopilot's words.
"""

from __future__ import annotations

import re

import pytest

from fleet import Goal, GoTo, Vector3
from fleet.errors import CommandError
from fleet.model.health import Level
from fleet.model.report import GpsReport

LONG = 240.0  # s
HEIGHT = 12.0  # m
SATELLITES = {"ardupilot": ("SIM_GPS_DISABLE", 1, 0), "px4": ("SIM_GPS_USED", 0, 10)}
BATTERY = {
    "ardupilot": (("BATT_FS_LOW_ACT", 2), ("BATT_LOW_VOLT", 11.5), ("SIM_BATT_VOLTAGE", 11.2)),
    "px4": (("COM_LOW_BAT_ACT", 3), ("SIM_BAT_DRAIN", 5.0), ("SIM_BAT_MIN_PCT", 6.0)),
}
FULL = {
    "ardupilot": (("SIM_BATT_VOLTAGE", 12.6),),
    "px4": (("SIM_BAT_MIN_PCT", 50.0), ("SIM_BAT_DRAIN", 600.0)),
}
REASON = re.compile("attery|ailsafe activated")  # PX4 without its events says no more


def flavour(it):
    """Return the name of the autopilot."""
    return it.adapter._session.flight.flavour.name


async def write(it, *values):
    """Write parameters, in flight too."""
    for name, value in values:
        await it.do("set_parameter", name=name, value=value, force=True)


async def takes_off(it):
    """Get ready and climb."""
    await it.until(lambda: it.robot.is_connected and it.state.home_altitude is not None, LONG)
    await it.until(lambda: it.state.estimator_has_position and it.state.prearm_ok, LONG)
    await it.do("takeoff", altitude=HEIGHT)


async def takes_nothing_that_needs_a_position(it):
    """Ask for a hold, the way home, a goal: refused, and whoever has it keeps it for the same reason."""
    authority = it.adapter._session.authority
    taker = authority.taker
    with pytest.raises(CommandError):
        await it.adapter.stop("hover")
    with pytest.raises(CommandError):
        await it.do("return_to_home")
    with pytest.raises(CommandError):
        await anext(aiter(it.adapter.navigate(GoTo(Goal(position=Vector3(5.0, 0.0, HEIGHT))))))
    assert authority.taker == taker
    assert "ailsafe" in it.robot.healths[-1].cause


async def loses_its_satellites(it):
    """Take them away: told soon, the fail-safe with its reason, then over."""
    name, off, on = SATELLITES[flavour(it)]
    await write(it, (name, off))
    try:
        await it.until(lambda: "no satellite fix" in it.robot.healths[-1].cause, 5.0)
        await it.until(lambda: it.robot.losses, 30.0)
        assert "ailsafe" in it.robot.losses[-1], it.robot.losses[-1]
        await it.until(lambda: "not reliable" in it.robot.healths[-1].cause, 10.0)
        assert "ailsafe" in it.robot.healths[-1].cause
        fixes = [each for each in it.robot.reports if isinstance(each, GpsReport)]
        assert fixes[-1].fix_type == "none"
        await takes_nothing_that_needs_a_position(it)
    finally:
        await write(it, (name, on))
    await it.until(lambda: "not reliable" not in it.robot.healths[-1].cause, 30.0)
    await it.do("land")


async def runs_out_of_battery(it):
    """Let it run low: it returns, and health and the loss say why."""
    await write(it, *BATTERY[flavour(it)])
    try:
        await it.until(lambda: it.robot.losses, 60.0)
        assert REASON.search(it.robot.losses[-1]), it.robot.losses[-1]
        assert it.robot.healths[-1].level is Level.DEGRADED
        assert REASON.search(it.robot.healths[-1].cause)
    finally:
        await it.do("land")
        await write(it, *FULL[flavour(it)])


LISTS = {
    "satellites": (takes_off, loses_its_satellites),
    "battery": (takes_off, runs_out_of_battery),
}
