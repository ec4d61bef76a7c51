"""Manoeuvres: the motion that each asks for, within the autopilot's speeds, and when it is done."""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.sim.manoeuvres import (
    IN_AIR,
    LANDING,
    TAKING_OFF,
    DriveManoeuvre,
    GoToManoeuvre,
    Idle,
    Land,
    OnGround,
    Return,
    Sink,
    Takeoff,
    Turn,
    aim_at,
    braked,
    hold,
    place_of,
    resting,
)
from fleet_mavlink.sim.physics import Agility, Body, MotionTarget

SPEEDS = {"cruise": 5.0, "top": 8.0, "climb": 2.5, "sink": 1.5, "takeoff": 2.0, "landing": (1.5, 0.5, 10.0)}
coordinate = st.floats(-500, 500)


def pilot_of(body, *, course=False, home=(0.0, 0.0, 0.0), landed=False, **more):
    speeds = SimpleNamespace(**SPEEDS, yaw_follows_course=course)
    return SimpleNamespace(
        body=body,
        speeds=speeds,
        agility=Agility(2.5, 2.5, 1.6),
        time=0.0,
        spin_up=2.0,
        has_position=True,
        home=SimpleNamespace(ned=lambda: home),
        land_detector=SimpleNamespace(landed=landed),
        **more,
    )


def flown(pilot, manoeuvre, seconds, *, until=lambda: False):
    """Fly a manoeuvre in steps of 20 ms; return how long it took."""
    for step in range(round(seconds * 50)):
        if until():
            return step / 50
        pilot.time += 0.02
        pilot.body.advance(manoeuvre.aim(pilot), pilot.agility, (0.0, 0.0), 0.02)
    return seconds


@given(coordinate, coordinate, st.floats(-100, 0))
def test_no_goal_is_flown_to_faster_than_its_speed_nor_climbed_to_faster_than_it_climbs(north, east, down):
    pilot = pilot_of(Body(down=-50.0))
    aim = aim_at(pilot, SimpleNamespace(north=north, east=east, down=down), 5.0, None)
    assert math.hypot(aim.vn, aim.ve) <= 5.0 + 1e-9
    assert -2.5 <= aim.vd <= 1.5
    assert aim.vn * east == pytest.approx(aim.ve * north, abs=1e-6)  # straight to it


def test_at_its_goal_it_asks_for_no_motion():
    assert aim_at(pilot_of(Body()), Body(), 5.0, None) == MotionTarget(0.0, 0.0, 0.0, None)


@pytest.mark.parametrize(
    ("north", "down", "done"), [(0.4, -10.3, True), (0.6, -10.0, False), (0.0, -10.5, False)]
)
def test_a_goal_is_reached_within_half_a_metre_and_four_tenths_of_height(north, down, done):
    pilot = pilot_of(Body(north=north, down=down))
    goal = GoToManoeuvre(0.0, 0.0, -10.0)
    goal.aim(pilot)
    assert goal.done is done


def test_a_goal_is_flown_to_and_held_without_passing_it():
    pilot = pilot_of(Body(down=-10.0))
    goal = GoToManoeuvre(30.0, -40.0, -15.0, speed=3.0)
    furthest = 0.0
    for _ in range(3000):
        flown(pilot, goal, 0.02)
        furthest = max(furthest, math.hypot(pilot.body.north, pilot.body.east))
    assert place_of(pilot.body) == pytest.approx((30.0, -40.0, -15.0), abs=0.1)
    assert furthest < 50.5


@pytest.mark.parametrize(
    ("course", "given_heading", "away", "heading"),
    [
        (True, None, 20.0, math.pi / 2),
        (True, None, 0.9, None),  # near it, the nose stays
        (False, None, 20.0, None),
        (True, 0.3, 20.0, 0.3),
    ],
)
def test_the_nose_turns_to_the_goal_where_the_autopilot_does_so_and_is_not_told_otherwise(
    course, given_heading, away, heading
):
    pilot = pilot_of(Body(down=-10.0), course=course)
    assert GoToManoeuvre(0.0, away, -10.0, heading=given_heading).aim(pilot).heading == heading


@pytest.mark.parametrize("speed", [0.5, 3.0, 10.0])
def test_it_brakes_to_a_place_ahead_and_stays_there(speed):
    pilot = pilot_of(Body(vn=speed, down=-10.0, heading=1.0))
    goal = braked(pilot)
    assert goal.north == pytest.approx(speed**2 / 5.0)
    assert (goal.east, goal.down, goal.heading) == (0.0, -10.0, 1.0)


def test_on_the_ground_a_hold_is_rest():
    assert type(hold(pilot_of(Body()))) is Idle
    assert not Idle().aim(pilot_of(Body())).thrust


def test_a_goal_that_is_given_on_the_ground_is_kept_and_not_flown():
    kept = resting(GoToManoeuvre(1.0, 2.0, -3.0))
    assert type(kept) is OnGround
    assert place_of(kept) == (1.0, 2.0, -3.0)
    assert not kept.aim(pilot_of(Body())).thrust
    assert type(resting(Sink(1.0))) is Idle


def test_a_take_off_spins_up_climbs_straight_and_is_in_the_air_at_its_height():
    pilot = pilot_of(Body(north=3.0, heading=0.5))
    climb = Takeoff(pilot, -10.0)
    assert climb.in_air_state == TAKING_OFF
    assert flown(pilot, climb, 5.0, until=lambda: pilot.body.height > 0.0) == pytest.approx(2.0, abs=0.1)
    flown(pilot, climb, 1.5)
    assert -pilot.body.vd <= 2.0 + 1e-9
    flown(pilot, climb, 20.0)
    assert (climb.done, climb.in_air_state) == (True, IN_AIR)
    assert place_of(pilot.body) == pytest.approx((3.0, 0.0, -10.0), abs=0.2)


def test_in_the_air_a_take_off_climbs_at_once():
    pilot = pilot_of(Body(down=-5.0))
    assert Takeoff(pilot, -10.0).aim(pilot).vd == -2.0


@pytest.mark.parametrize("velocity", [(20.0, 0.0, 0.0), (-6.0, -8.0, 9.0), (1.0, 0.0, -9.0)])
def test_a_velocity_keeps_its_direction_within_the_limits(velocity):
    aim = DriveManoeuvre(velocity).aim(pilot_of(Body(down=-10.0)))
    asked = math.hypot(*velocity[:2])
    share = min(1.0, 8.0 / asked)
    assert (aim.vn, aim.ve) == pytest.approx((velocity[0] * share, velocity[1] * share))
    assert -2.5 <= aim.vd <= 1.5


def test_an_old_velocity_is_a_standstill():
    pilot = pilot_of(Body(down=-10.0))
    drive = DriveManoeuvre((3.0, 0.0, 0.0), until=1.0)
    pilot.time = 1.0
    assert drive.aim(pilot).vn == 3.0
    pilot.time = 1.01
    assert drive.aim(pilot) == MotionTarget()


@pytest.mark.parametrize(
    ("course", "rate", "turns"), [(True, None, 0.9), (True, 0.2, 0.2), (False, None, 0.0)]
)
def test_the_nose_turns_into_a_velocity_unless_a_rate_is_given(course, rate, turns):
    pilot = pilot_of(Body(down=-10.0), course=course)
    assert DriveManoeuvre((0.0, 3.0, 0.0), turn_rate=rate).aim(pilot).turn_rate == pytest.approx(turns)


@pytest.mark.parametrize(("direction", "turned"), [(1, 1.57), (-1, -4.71)])
def test_a_turn_goes_the_way_it_is_told_and_ends_at_its_heading(direction, turned):
    pilot = pilot_of(Body(down=-10.0))
    turn, total = Turn(pilot, math.pi / 2, 0.5, direction), 0.0
    for _ in range(1000):
        before = pilot.body.heading
        flown(pilot, turn, 0.02)
        total += math.remainder(pilot.body.heading - before, math.tau)
    assert total == pytest.approx(turned, abs=0.05)
    assert pilot.body.heading == pytest.approx(math.pi / 2, abs=0.05)


def test_a_landing_is_slow_near_the_ground_and_done_on_it():
    pilot = pilot_of(Body(down=-12.0))
    landing = Land(pilot)
    assert landing.in_air_state == LANDING
    assert landing.aim(pilot).vd == 1.5
    pilot.body.down = -9.9
    assert landing.aim(pilot).vd == 0.5
    flown(pilot, landing, 30.0)
    assert (landing.done, pilot.body.grounded) == (True, True)


def test_without_a_position_it_lands_where_it_drifts():
    pilot = pilot_of(Body(north=5.0, down=-5.0))
    landing = Land(pilot, Body())
    assert landing.aim(pilot).vn < 0.0
    pilot.has_position = False
    assert (landing.aim(pilot).vn, landing.aim(pilot).ve) == (0.0, 0.0)


def test_it_returns_at_its_height_waits_over_home_and_lands_there():
    pilot = pilot_of(Body(north=40.0, down=-5.0), home=(1.0, 2.0, 0.0))
    back = Return(pilot, 15.0, 3.0)
    flown(pilot, back, 60.0, until=lambda: pilot.body.north < 35.0)
    assert pilot.body.height == pytest.approx(15.0, abs=0.5)
    arrived = flown(
        pilot, back, 60.0, until=lambda: math.hypot(pilot.body.north - 1, pilot.body.east - 2) < 0.5
    )
    waited = flown(pilot, back, 60.0, until=lambda: back.in_air_state == LANDING)
    assert arrived < 60.0
    assert 2.9 < waited < 4.5
    flown(pilot, back, 60.0)
    assert back.done
    assert (pilot.body.north, pilot.body.east) == pytest.approx((1.0, 2.0), abs=0.5)


def test_higher_than_its_return_it_stays_so_and_on_the_ground_it_rests():
    high = pilot_of(Body(north=40.0, down=-30.0))
    flown(high, Return(high, 15.0, 0.0), 5.0)
    assert high.body.height == pytest.approx(30.0, abs=0.5)
    ground = pilot_of(Body(), landed=True)
    back = Return(ground, 15.0, 0.0)
    flown(ground, back, 5.0)
    assert (ground.body.height, back.done) == (0.0, True)
