"""What a vehicle is put through that another station moves: the adapter takes it, and stops it.

A plane or a VTOL on PX4.
"""

from __future__ import annotations

import math

from fleet.model.report import FlightControllerReport, GpsReport, PoseReport
from fleet_mavlink.constants import PX4, type_name

LONG = 240.0  # s
HOVERS, FLIES_FORWARD = 3, 4
CIRCLE = 80.0  # m, its radius


def vehicle(it):
    return it.adapter._session.vehicle


def mode(it):
    return vehicle(it).kind.mode_of(it.state)


def speed(it):
    return it.state.velocity.horizontal() if it.state.velocity else 0.0


async def is_met(it, _other):
    """Hear it, and let it tell what it is and where."""
    await it.until(lambda: it.robot.is_connected and it.state.estimator_has_position, LONG)
    await it.until(lambda: it.state.home is not None and it.state.prearm_ok, LONG)
    for kind in (PoseReport, GpsReport, FlightControllerReport):
        await it.until(lambda kind=kind: any(isinstance(each, kind) for each in it.robot.reports), LONG)


async def is_flown_by_the_other(it, other):
    """Have it take off."""
    height = 25.0
    other.request(400, 1)
    await it.until(lambda: it.state.armed, LONG)
    other.request(22, math.nan, 0, 0, math.nan, math.nan, math.nan, it.state.home_altitude + height)
    await it.until(lambda: it.state.relative_altitude > height * 0.7 and mode(it) == "AUTO.LOITER", LONG)


async def a_hovering_one_is_stopped(it, other):
    """Send it away; it stands where it was stopped."""
    if it.state.vtol_state != HOVERS:
        return
    other.go(300.0, 0.0, 25.0)
    await it.until(lambda: speed(it) > 3.0, LONG)
    await it.adapter.stop("hover")
    await it.until(lambda: speed(it) < 0.7, 15.0)
    other.request(3000, FLIES_FORWARD)
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
    "fixed_wing": (is_met, is_flown_by_the_other, one_with_wings_circles),
    "vtol_fixedrotor": (
        is_met,
        is_flown_by_the_other,
        a_hovering_one_is_stopped,
        one_with_wings_circles,
    ),
}


def steps_for(it):
    """Return what a vehicle is put through; nothing of another type."""
    beat = it.state.heartbeat
    return STEPS.get(type_name(beat.type), ()) if beat.autopilot == PX4 else ()
