"""The targets of a standing and a walking dog: heights, torques under its weight, speed, gait."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet import Quaternion, Vector3
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.measured import ZEROS, BodyMeasurement, MeasuredImu
from fleet_quadruped.body.walk import Walker
from fleet_quadruped.robot.description import EXAMPLE, leg_angles, load_description

DOG = load_description(EXAMPLE)
DT, HEIGHT = 0.01, DOG.gait.height
LEVEL = MeasuredImu(Quaternion(1.0, 0.0, 0.0, 0.0), Vector3(), Vector3(z=9.81))
INTEGRAL, CORRECTION = 0.8, 0.25  # 1/s; m/s


class Led:
    """A walker whose joints are where they were led in the last cycle; ``held``: they do not turn."""

    def __init__(self, height=HEIGHT, *, held=False, imu=LEVEL):
        self.walker = Walker(DOG)
        self.walker.stand(height)
        self.imu, self.held = imu, held
        self.sense = BodyMeasurement(DOG.stance(height), ZEROS, imu)

    def go(self, seconds, twist=Twist()):  # noqa: B008
        """Return the targets of each cycle."""
        seen = []
        for _ in range(round(seconds / DT)):
            targets = self.walker.step(DT, twist, self.sense)
            self.sense = BodyMeasurement(targets.angles, ZEROS if self.held else targets.speeds, self.imu)
            seen.append(targets)
        return seen


def feet(targets):
    """Return the feet in the body frame, m."""
    places = [leg.foot(leg_angles(targets.angles, number)) for number, leg in enumerate(DOG.legs)]
    return [(leg.x + x, leg.y + y, z) for leg, (x, y, z) in zip(DOG.legs, places, strict=True)]


def centre(targets):
    """Return the mean of the feet, m: ahead of the body's centre, and to its left."""
    places = feet(targets)
    return sum(place[0] for place in places) / 4, sum(place[1] for place in places) / 4


def mean_centre(twist):
    """Return where the feet are about the body in two cycles of a steady trot, m."""
    seen = [centre(targets) for targets in Led().go(3.0, twist)[-84:]]
    return sum(x for x, _ in seen) / 84, sum(y for _, y in seen) / 84


def limp_legs(targets):
    """Return the legs whose joints have no torque."""
    return {number for number in range(4) if not any(leg_angles(targets.torques, number))}


def ground_speed(before, now):
    """Return how fast the feet under load go back, m/s."""
    loaded = [number for number in range(4) if number not in limp_legs(now) | limp_legs(before)]
    speeds = [(feet(before)[number][0] - feet(now)[number][0]) / DT for number in loaded]
    return sum(speeds) / len(speeds)


@pytest.mark.parametrize("height", [DOG.gait.lowest, 0.27, DOG.gait.highest])
def test_a_standing_dog_is_led_to_its_stance_and_at_rest(height):
    targets = Led(height).go(0.05)[-1]
    assert targets.angles == pytest.approx(DOG.stance(height), abs=1e-9)
    assert targets.speeds == pytest.approx(ZEROS, abs=1e-9)


def test_the_torques_do_the_work_of_lifting_the_weight():
    rise = 1e-5  # m
    torques = Led().go(0.5)[-1].torques
    lifted = zip(torques, DOG.stance(HEIGHT), DOG.stance(HEIGHT + rise), strict=True)
    assert sum(torque * (after - before) for torque, before, after in lifted) == pytest.approx(
        DOG.robot.mass * 9.81 * rise, rel=1e-3
    )


def test_the_torques_push_the_body_over_its_feet_as_it_sways():
    led, step = Led(), 1e-5  # m
    led.walker.gait = "walk"
    led.go(2.4, Twist(0.15))
    places, torques = feet(led.sense), led.go(DT, Twist(0.15))[-1].torques
    push = led.walker._steps.balance.push(led.walker.height)
    assert min(map(abs, push)) > 0.001
    for along, (x, y) in zip(push, ((step, 0.0), (0.0, step)), strict=True):
        work = 0.0
        for number, (leg, place) in enumerate(zip(DOG.legs, places, strict=True)):
            here = (place[0] - leg.x, place[1] - leg.y, place[2])
            there = (here[0] - x, here[1] - y, here[2])  # where the body's motion leaves the foot
            turned = zip(leg_angles(torques, number), leg.angles(here), leg.angles(there), strict=True)
            work += sum(torque * (after - before) for torque, before, after in turned)
        assert work == pytest.approx(DOG.robot.mass * 9.81 * along * step, rel=0.02)


def test_a_foot_in_the_air_has_no_torque_and_two_carry_a_trot():
    seen = [limp_legs(targets) for targets in Led().go(2.0, Twist(0.4))[50:]]
    assert {frozenset(legs) for legs in seen} == {frozenset(), frozenset({0, 3}), frozenset({1, 2})}


def test_a_height_is_reached_at_a_tenth_of_a_metre_a_second():
    led = Led()
    assert led.walker.change_height(-0.05) == ""
    led.go(0.2)
    assert led.walker.height == pytest.approx(HEIGHT - 0.02)
    led.go(1.0)
    assert led.walker.height == pytest.approx(HEIGHT - 0.05)
    assert feet(led.go(DT)[-1])[0][2] == pytest.approx(DOG.geometry.foot_radius - HEIGHT + 0.05, abs=1e-6)


def test_changes_of_height_add_up_before_they_are_reached():
    walker = Led().walker
    for _ in range(3):
        walker.change_height(-0.02)
    assert walker.wanted_height == pytest.approx(HEIGHT - 0.06)
    walker.change_height(0.01)
    assert walker.wanted_height == pytest.approx(HEIGHT - 0.05)


@settings(max_examples=25)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=5))
def test_no_change_leads_beyond_the_heights_of_the_gait(changes):
    walker = Walker(DOG)
    assert {walker.change_height(change) for change in changes} <= {""}
    assert DOG.gait.lowest <= walker.wanted_height <= DOG.gait.highest


@pytest.mark.parametrize("change", [math.nan, math.inf, -math.inf])
def test_a_height_that_is_no_number_is_refused(change):
    walker = Walker(DOG)
    assert walker.change_height(change) == f"{change} is not a height"
    assert walker.wanted_height == HEIGHT


def test_hot_drives_slow_it_down_by_their_share():
    led = Led()
    led.walker.speed_share = 0.25
    led.go(3.0, Twist(5.0))
    assert led.walker.odometry.twist.x == pytest.approx(0.25 * DOG.gait.speed, rel=0.05)


def test_a_velocity_that_is_no_number_is_none():
    led = Led()
    led.go(0.5, Twist(math.nan))
    assert not led.walker.walking


def test_the_velocity_loop_adds_what_is_missing_up_to_a_quarter_of_a_metre_a_second():
    led = Led(held=True)
    seen = led.go(1.0, Twist(0.2))
    wanted = [min(0.2, DOG.gait.acceleration * DT * (cycle + 1)) for cycle in range(100)]
    added = INTEGRAL * DT * sum(wanted)
    assert ground_speed(*seen[-2:]) == pytest.approx(0.2 + added, abs=0.01)
    assert ground_speed(*led.go(6.0, Twist(0.2))[-2:]) == pytest.approx(0.2 + CORRECTION, abs=0.01)


def test_the_velocity_loop_forgets_what_it_added_when_the_dog_stands():
    led = Led(held=True)
    led.go(6.0, Twist(0.2))
    led.go(3.0)
    assert not led.walker.walking
    assert ground_speed(*led.go(0.5, Twist(0.2))[-2:]) < 0.2 + 0.1


TURNS = [(Twist(0.5, 0.0, 0.8), 1), (Twist(0.5, 0.0, -0.8), -1), (Twist(-0.5, 0.0, 0.8), -1)]


@pytest.mark.parametrize(("twist", "side"), TURNS)
def test_it_leans_into_a_turn(twist, side):
    lean = mean_centre(Twist(twist.x))[1] - mean_centre(twist)[1]
    assert lean * side == pytest.approx(0.4 * HEIGHT / 9.81, rel=0.25)  # the acceleration over gravity's


def test_it_leans_to_the_rear_while_it_turns_left_and_walks_to_the_left():
    lean = mean_centre(Twist(0.0, 0.25))[0] - mean_centre(Twist(0.0, 0.25, 0.9))[0]
    assert lean == pytest.approx(-0.25 * 0.9 * HEIGHT / 9.81, rel=0.25)


def test_it_leans_into_its_start_by_half():
    seen = Led().go(0.2, Twist(0.8))
    went = DOG.gait.acceleration * 0.2**2 / 2  # m: the ground, under the two feet that stand
    stands = (feet(seen[-1])[1][0] + feet(seen[-1])[2][0]) / 2
    full = DOG.gait.acceleration * HEIGHT / 9.81 * (1 - math.exp(-0.2 / 0.1))
    assert -stands - went == pytest.approx(0.5 * full, rel=0.25)


def test_a_change_of_gait_waits_until_the_dog_stands():
    led = Led()
    led.go(1.0, Twist(0.15))
    led.walker.gait = "walk"
    assert led.walker.time_to_stand == DOG.time_to_stand("trot")
    led.go(0.5, Twist(0.15))
    assert led.walker.odometry.twist.x < 0.15 / 2  # it slows down although it is asked to walk on
    changed = led.go(6.0, Twist(0.15))
    assert led.walker.time_to_stand == DOG.time_to_stand("walk")
    assert max(len(limp_legs(targets)) for targets in changed[-300:]) == 1


def test_to_stand_is_a_new_beginning():
    led = Led()
    led.go(1.3, Twist(0.5))
    led.walker.stand(0.2)
    led.sense = BodyMeasurement(DOG.stance(0.2), ZEROS, LEVEL)
    assert (led.walker.walking, led.walker.height, led.walker.wanted_height) == (False, 0.2, 0.2)
    targets = led.go(DT)[-1]
    assert targets.angles == pytest.approx(DOG.stance(0.2), abs=1e-9)
    assert targets.speeds == ZEROS


def test_to_stand_forgets_what_the_velocity_loop_added():
    led = Led(held=True)
    led.go(3.0, Twist(0.2))
    led.walker.stand(HEIGHT)
    assert ground_speed(*led.go(0.1, Twist(0.2))[-2:]) < 0.15


def test_without_an_imu_it_walks_as_on_level_ground():
    with_imu, without = Led().go(1.0, Twist(0.3)), Led(imu=None).go(1.0, Twist(0.3))
    assert without[-1].angles == pytest.approx(with_imu[-1].angles, abs=0.02)
