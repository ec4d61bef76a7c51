"""What a vehicle that is not moved here is put through: another station moves it, and the adapter stops it.

A plane or a VTOL on PX4.
"""

from __future__ import annotations

import math

import pytest

from fleet import Unsupported, Vector3, Velocity
from fleet.model.report import FlightControllerReport, GpsReport, PoseReport
from fleet_mavlink.constants import type_name

LONG = 240.0  # s
HOVERS, FLIES_FORWARD = 3, 4
CIRCLE = 80.0  # m, its radius


def vehicle(it):
    return it.adapter._session.vehicle


def mode(it):
    return vehicle(it).kind.mode_of(it.state)


def speed(it):
    return it.state.velocity.horizontal() if it.state.velocity else 0.0


async def is_met_and_named(it, _other):
    """Hear it, and let it tell what it is and where."""
    await it.until(lambda: it.robot.is_connected and it.state.estimator_has_position, LONG)
    await it.until(lambda: it.state.home is not None and it.state.prearm_ok, LONG)
    for kind in (PoseReport, GpsReport, FlightControllerReport):
        await it.until(lambda kind=kind: any(isinstance(each, kind) for each in it.robot.reports), LONG)
    told = next(each for each in it.robot.reports if isinstance(each, FlightControllerReport))
    assert told.vehicle in it.robot.healths[-1].cause


async def is_not_moved_by_us(it, _other):
    """Ask for what it would be moved by; nothing is sent."""
    with pytest.raises(Unsupported, match=r"not moved here"):
        it.adapter.drive(Velocity(Vector3(1.0, 0.0, 0.0)))
    with pytest.raises(Unsupported, match=r"not moved here"):
        await it.do("takeoff")


async def is_flown_by_the_other(it, other):
    """Have it take off."""
    height = 25.0
    other.ask(400, 1)
    await it.until(lambda: it.state.armed, LONG)
    other.ask(22, math.nan, 0, 0, math.nan, math.nan, math.nan, it.state.home_altitude + height)
    await it.until(lambda: it.state.relative_altitude > height * 0.7 and mode(it) == "AUTO.LOITER", LONG)


async def a_hovering_one_is_stopped(it, other):
    """Send it away; it stands where it was stopped."""
    if it.state.vtol_state != HOVERS:
        return
    other.go(300.0, 0.0, 25.0)
    await it.until(lambda: speed(it) > 3.0, LONG)
    await it.adapter.stop("stop")
    await it.until(lambda: speed(it) < 0.7, 15.0)
    other.ask(3000, FLIES_FORWARD)
    await it.until(lambda: it.state.vtol_state == FLIES_FORWARD, LONG)


async def one_with_wings_circles(it, other):
    """Send it far away; it goes round where it was stopped."""
    other.go(3000.0, 0.0, 30.0)
    await it.until(lambda: it.state.velocity.x > 6.0, LONG)
    where = it.state.position
    await it.adapter.stop("emergency_stop")
    began = vehicle(it).now()
    await it.until(lambda: vehicle(it).now() - began > 30.0, LONG)
    away = (it.state.position.latitude - where.latitude) * 111_195
    assert abs(away) < 3 * CIRCLE, f"it went on {away:.0f} m"
    assert mode(it) == "AUTO.LOITER"


STEPS = {
    "fixed_wing": (is_met_and_named, is_not_moved_by_us, is_flown_by_the_other, one_with_wings_circles),
    "vtol_fixedrotor": (
        is_met_and_named,
        is_not_moved_by_us,
        is_flown_by_the_other,
        a_hovering_one_is_stopped,
        one_with_wings_circles,
    ),
}


def steps_for(it):
    """Return what a vehicle is put through; nothing where it is flown here."""
    return STEPS.get(type_name(it.state.heartbeat.type), ())
