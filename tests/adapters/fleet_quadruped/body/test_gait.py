import itertools
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fleet_quadruped.body.gait import GaitSteps, Twist
from fleet_quadruped.body.pattern import walk as slow
from fleet_quadruped.body.velocity_ramp import limited, ramped
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)
LEVEL = (0.0, 0.0)
speeds = st.builds(Twist, st.floats(-0.8, 0.8), st.floats(-0.3, 0.3), st.floats(-1, 1))


def trot():
    return GaitSteps(DOG.gait, DOG.legs, DOG.geometry.foot_radius)


def walk(gait, twist, seconds, dt=0.01):
    feet = []
    for _ in range(round(seconds / dt)):
        feet = gait.step(dt, twist, Twist(), 0.27, tilt=LEVEL)
    return feet


def test_a_standing_dog_keeps_all_feet_down():
    gait = trot()
    walk(gait, Twist(), 1.0)
    assert gait.stance == [True] * 4
    assert not gait.walking


def test_diagonal_feet_swing_together_and_two_stand_at_all_times():
    gait = trot()
    seen = set()
    for _ in range(200):
        gait.step(0.01, Twist(0.5), Twist(), 0.27, tilt=LEVEL)
        fl, fr, rl, rr = gait.stance
        assert fl == rr
        assert fr == rl
        assert sum(gait.stance) >= 2
        seen.add(fl)
    assert seen == {True, False}


def test_standing_feet_move_back_as_fast_as_the_body_moves_on():
    gait = trot()
    walk(gait, Twist(0.4), 1.0)
    before, stood = list(gait.feet), list(gait.stance)
    gait.step(0.01, Twist(0.4), Twist(), 0.27, tilt=LEVEL)
    number = next(n for n in range(4) if stood[n] and gait.stance[n])
    assert (gait.feet[number][0] - before[number][0]) / 0.01 == pytest.approx(-0.4)


def test_it_ends_two_cycles_after_the_velocity():
    gait = trot()
    walk(gait, Twist(0.4), 1.0)
    walk(gait, Twist(), 2.0 * DOG.gait.period + 0.05)
    assert not gait.walking


def test_a_standing_dog_that_is_tilted_steps():
    gait = trot()
    gait.step(0.01, Twist(), Twist(), 0.27, tilt=(0.2, 0.0))
    assert gait.walking


def test_a_dog_rolled_to_the_right_shortens_its_left_legs():
    left, right = (trot().step(0.01, Twist(), Twist(), 0.27, tilt=(0.1, 0.0))[number][2] for number in (0, 1))
    assert left > right


@given(speeds, st.floats(0.004, 0.05))
@example(Twist(0.78125, 0.0, 1.0), 0.047110314212078314)
def test_feet_stay_within_reach_whatever_the_cycle(twist, dt):
    gait = trot()
    late = dt * math.hypot(twist.x, twist.y)  # a foot leaves the ground up to a cycle late
    for _ in range(120):
        for number, (x, y, z) in enumerate(gait.step(dt, twist, Twist(), 0.27, tilt=LEVEL)):
            leg = DOG.legs[number]
            away = math.hypot(x - leg.x, y - leg.y - leg.side * leg.offset)
            assert away < DOG.gait.reach + 0.1 + late
            assert -0.35 < z < -0.15


def margin(feet):
    """Return how far (m) the body's centre is inside the feet that stand; negative outside."""
    around = sorted(feet, key=lambda foot: math.atan2(foot[1], foot[0]))
    edges = itertools.pairwise([*around, around[0]])
    return min((a[0] * b[1] - a[1] * b[0]) / math.dist(a, b) for a, b in edges)


@pytest.mark.parametrize("twist", [Twist(0.15), Twist(-0.15), Twist(0, 0.08), Twist(0, 0, 0.35)])
def test_walking_the_body_is_always_over_the_feet_that_stand(twist):
    gait = trot()
    assert gait.choose(slow(DOG.gait, DOG.legs))
    walk(gait, twist, 2.0)
    for _ in range(300):
        feet = gait.step(0.01, twist, Twist(), 0.27, tilt=LEVEL)
        standing = [foot[:2] for foot, stands in zip(feet, gait.stance, strict=True) if stands]
        assert len(standing) >= 3
        assert margin(standing) > 0.01


slowly = st.builds(Twist, st.floats(-0.15, 0.15), st.floats(-0.08, 0.08), st.floats(-0.35, 0.35))


@settings(max_examples=40)
@given(st.lists(st.tuples(slowly, st.floats(0.1, 3.0)), min_size=1, max_size=4))
def test_walking_it_presses_amid_the_feet_that_stand_however_velocities_change(given):
    gait, now = trot(), Twist()
    gait.choose(slow(DOG.gait, DOG.legs))
    for wanted, seconds in given:
        for _ in range(round(seconds / 0.01)):
            now = ramped(now, gait.feasible_velocity(limited(wanted, DOG.gait.walk)), DOG.gait.walk, 0.01)
            gait.step(0.01, now, Twist(), 0.27, tilt=LEVEL)
            x, y = gait.balance.place
            pairs = zip(gait.feet, gait.stance, strict=True)
            assert margin([(foot[0] - x, foot[1] - y) for foot, stands in pairs if stands]) > 0.01


def test_walking_begins_with_the_body_aside_before_a_foot_leaves_the_ground():
    gait = trot()
    gait.choose(slow(DOG.gait, DOG.legs))
    while all(gait.stance):
        gait.step(0.01, Twist(0.1), Twist(), 0.27, tilt=LEVEL)
    assert gait.stance == [True, True, False, True]
    assert gait.balance.y < -0.03


def test_a_foot_that_was_put_down_for_another_velocity_slows_the_walk_down():
    gait = trot()
    gait.choose(slow(DOG.gait, DOG.legs))
    walk(gait, Twist(0.15), 3.0)
    assert gait.feasible_velocity(Twist(0.15)) == Twist(0.15)
    assert -0.1 < gait.feasible_velocity(Twist(-0.15)).x < 0.0
    assert gait.feasible_velocity(Twist()) == Twist()


def test_it_stops_only_where_all_feet_come_down():
    for velocity, pattern in ((0.4, None), (0.1, slow(DOG.gait, DOG.legs))):
        gait = trot()
        if pattern:
            gait.choose(pattern)
        walk(gait, Twist(velocity), 1.7)
        while gait.walking:
            highest = max(foot[2] for foot in gait.feet)
            gait.step(0.01, Twist(), Twist(), 0.27, tilt=LEVEL)
        assert highest < 0.012


def test_another_gait_begins_only_from_standing():
    gait = trot()
    walk(gait, Twist(0.4), 1.0)
    assert not gait.choose(slow(DOG.gait, DOG.legs))
    walk(gait, Twist(), 1.0)
    assert gait.choose(slow(DOG.gait, DOG.legs))
