"""A dog whose joints are led: how far, how fast, and how that ends; it is never dropped."""

import itertools
import random

import msgspec
import pytest

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.safety.stages import BodyMode
from tests.adapters.fleet_quadruped.copies import copy_of, standing_dog, standing_in_physics
from tests.adapters.fleet_quadruped.kinds import on_one_kind

TILTED = 0.35  # rad: less than half of the tilt at which it would let go (0.785)


def lead(rig, seconds, joints, *, lives=0.3):
    """Lead joints for a while, told again in each cycle; returns how they were sent, cycle by cycle."""
    sent = []
    for _ in range(round(seconds / rig.dog.dt)):
        rig.order = msgspec.structs.replace(
            rig.order, joints=tuple(joints), joints_until=rig.sim.time + lives
        )
        rig.cycle()
        sent.append(rig.controller.targets)
    return sent


def halt(rig):
    """Stop it, as every stop of the adapter does; targets still come."""
    rig.order = msgspec.structs.replace(rig.order, halts=rig.order.halts + 1)
    rig.cycle()


def led(dog):
    rig = standing_dog(dog)
    assert rig.request(BodyRequest.POSE) == ""
    rig.go(0.1)
    assert rig.mode is BodyMode.POSING
    return rig


@pytest.fixture
def standing(any_dog):
    return copy_of(led, any_dog)


def posture(rig):
    return rig.state().posture


PATTERNS = {
    "every joint up": [1.0] * 12,
    "every joint down": [-1.0] * 12,
    "one side long, the other short": [sign * part for sign in (1, -1, 1, -1) for part in (1, 1, 1)],
    "front long, rear short": [sign for sign in (1, 1, -1, -1) for _ in range(3)],
    "each leg against its neighbours": [sign for sign in (1, -1, -1, 1) for _ in range(3)],
    "knees against hips": list(itertools.islice(itertools.cycle((0.0, 1.0, -1.0)), 12)),
}


@pytest.mark.combinations
@pytest.mark.parametrize("pattern", PATTERNS.values(), ids=PATTERNS)
def test_wherever_its_joints_are_led_a_standing_dog_goes_on_standing(standing, pattern):
    start = posture(standing)
    sent = lead(standing, 2.5, [at + 5 * sign for at, sign in zip(start, pattern, strict=True)])
    reach, speed = standing.dog.safety.joint_reach, standing.dog.safety.joint_speed
    assert max(abs(to - at) for to, at in zip(sent[-1], start, strict=True)) <= reach + 0.02
    assert max(abs(to - at) for to, at in zip(sent[-1], start, strict=True)) > reach / 2
    fastest = max(
        abs(now - then) for a, b in itertools.pairwise(sent) for then, now in zip(a, b, strict=True)
    )
    assert fastest <= 2 * speed * standing.dog.dt + 1e-3
    assert standing.mode is BodyMode.POSING
    assert standing.fault == ""
    assert standing.request(BodyRequest.STAND) == ""
    standing.go(2.0, until=BodyMode.STANDING)
    assert standing.mode is BodyMode.STANDING


WORST = random.Random(3)
ANY = [[WORST.choice((-1.0, 1.0)) for _ in range(12)] for _ in range(9)]
PHYSICS = {
    "the worst of nine at random for CiA 402": ANY[8],
    "and for the others": ANY[6],
} | {name: pattern for name, pattern in PATTERNS.items() if "short" in name}


@pytest.mark.combinations
@pytest.mark.parametrize("pattern", PHYSICS.values(), ids=PHYSICS)
def test_in_physics_it_does_not_fall_wherever_its_joints_are_led(any_dog, pattern):
    rig = standing_in_physics(any_dog)
    assert rig.request(BodyRequest.POSE) == ""
    rig.go(0.1)
    lead(rig, 1.5, [at + 5 * sign for at, sign in zip(posture(rig), pattern, strict=True)])
    assert rig.tilt < TILTED
    assert rig.mode in {BodyMode.POSING, BodyMode.HELD}  # held: it leans, and is led no further
    assert rig.request(BodyRequest.STAND) == ""
    rig.go(2.0)
    assert (rig.mode, rig.fault) == (BodyMode.STANDING, "")
    assert rig.sim.world.imu().tilt < 0.05


@on_one_kind
def test_joints_that_nobody_leads_any_more_hold_where_they_are(standing):
    at = posture(standing)[2]
    lead(standing, 0.3, [None, None, at + 0.2])
    standing.go(0.4)
    held = standing.controller.targets[2]
    assert 0.03 < held - at < 0.19
    standing.go(1.0)
    assert standing.controller.targets[2] == pytest.approx(held, abs=0.005)
    assert standing.mode is BodyMode.POSING


@on_one_kind
def test_any_stop_holds_the_posture_and_ends_the_mode_though_targets_come(standing):
    at = posture(standing)[2]
    lead(standing, 0.3, [None, None, at + 0.2])
    halt(standing)
    held = standing.controller.targets[2]
    lead(standing, 1.0, [None, None, at - 0.2])
    assert standing.mode is BodyMode.HELD
    assert standing.controller.targets[2] == pytest.approx(held, abs=0.005)
    assert standing.request(BodyRequest.POSE) == ""
    lead(standing, 1.0, [None, None, at])
    assert standing.controller.targets[2] == pytest.approx(at, abs=0.01)


@on_one_kind
def test_a_stop_on_the_way_back_to_standing_stops_that_too(standing):
    at = posture(standing)[2]
    lead(standing, 1.0, [None, None, at + 0.2])
    standing.request(BodyRequest.STAND)
    standing.go(0.2)
    halt(standing)
    held = standing.controller.targets[2]
    standing.go(1.0)
    assert standing.mode is BodyMode.HELD
    assert standing.controller.targets[2] == pytest.approx(held, abs=0.005)


@pytest.mark.combinations
@pytest.mark.parametrize("stopped", [False, True])
def test_it_sits_down_from_the_posture_that_it_has(standing, stopped):
    lead(standing, 1.0, [at + 0.15 for at in posture(standing)])
    if stopped:
        halt(standing)
    assert standing.request(BodyRequest.SIT) == ""
    standing.go(3.0, until=BodyMode.OFF)
    assert standing.mode is BodyMode.OFF
    assert standing.tilt < TILTED
    assert standing.fault == ""


@on_one_kind
def test_an_emergency_stop_lets_it_down(standing):
    lead(standing, 1.0, [at + 0.15 for at in posture(standing)])
    standing.emergency()
    standing.go(0.1)
    assert standing.mode is BodyMode.DAMPED
    standing.go(4.0, until=BodyMode.OFF)
    assert standing.mode is BodyMode.OFF
    assert standing.request(BodyRequest.POSE) != ""


@on_one_kind
def test_without_its_host_it_holds_and_then_sits_down(any_dog):
    safety = any_dog.safety.model_copy(update={"abandoned": 3.0})
    standing = copy_of(led, any_dog.model_copy(update={"safety": safety}))
    lead(standing, 0.5, [at + 0.15 for at in posture(standing)], lives=60.0)
    standing.alive = False
    standing.go(1.0)
    held = standing.controller.targets
    standing.go(1.0)
    assert standing.controller.targets == pytest.approx(held, abs=0.005)
    standing.go(standing.dog.safety.abandoned + 3.0, until=BodyMode.OFF)
    assert standing.mode is BodyMode.OFF


@on_one_kind
def test_a_dog_that_lies_is_held_as_it_is_found_and_led_from_there(rig):
    rig.settle()
    assert rig.request(BodyRequest.POSE) == ""
    rig.go(1.5, until=BodyMode.POSING)
    assert rig.mode is BodyMode.POSING
    rig.cycle()
    start = posture(rig)
    lead(rig, 1.5, [None, None, None, None, start[4] + 0.1])
    assert rig.controller.targets[4] == pytest.approx(start[4] + 0.1, abs=0.01)
    halt(rig)
    assert rig.request(BodyRequest.SIT) == ""
    rig.go(3.0, until=BodyMode.OFF)
    assert rig.mode is BodyMode.OFF


@pytest.mark.combinations
@pytest.mark.parametrize(
    "request_and_stop",
    list(itertools.product([BodyRequest.POSE, BodyRequest.STAND, BodyRequest.RECOVER], [False, True])),
    ids=lambda both: f"{both[0]}-{'then' if both[1] else 'before'}",
)
def test_a_stop_before_its_drives_are_enabled_leaves_a_lying_dog_off(rig, request_and_stop):
    given, later = request_and_stop
    rig.settle()
    if later:
        rig.request(given)
        assert rig.mode is BodyMode.ENABLING
    rig.order = msgspec.structs.replace(rig.order, halts=rig.order.halts + 1)
    if not later:
        rig.request(given)
    rig.go(2.0)
    assert rig.mode is BodyMode.OFF


@on_one_kind
def test_a_dog_that_walks_is_not_led(any_dog):
    rig = standing_dog(any_dog)
    rig.go(0.5, Twist(0.3))
    assert "walking" in rig.request(BodyRequest.POSE)
