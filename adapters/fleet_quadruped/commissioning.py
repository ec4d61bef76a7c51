"""Signs and offsets of the joints, estimated from the small moves of ``fleet can check --move``.

The feet stay in place on a level floor while the trunk is shifted and tilted. With correct signs and offsets,
joints and IMU together put each foot at one place in all observations, and all feet on one plane. Least
squares finds the single mirrored or shifted joint that explains the observations best: this joint is free,
the offsets of all others are as small as manufacturing errors, the floor and the IMU are nearly level.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from fleet import Quaternion, Vector3
from fleet_quadruped.body.legs import DogLeg, LegPoint
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.body.turning import to_world
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS, LEGS, Twelve

_FOOT = 0.0005  # m: standard error of a foot's height above the floor
_STUCK = 0.005  # m: standard error of a foot that stays in place
_MADE = 0.02  # rad: manufacturing errors of offsets and mounting angles
_FREE = 1.5  # rad: standard error of the offset of the joint under test
_ROUNDS = 5
_JOINTS = len(JOINTS)
_COUNT = _JOINTS + 4  # offsets; the floor's slopes along x and y; the IMU's mounting about x and y
# step of the numerical derivatives
_SMALL = 1e-5
_LEAST = 3  # observations needed for any conclusion
_UNLIKELY = 25.0  # cost that no correct robot reaches: the worst of 50 had 16
_BETTER, _OFF = 5.0, 0.06  # lowest gain of cost, and lowest offset (rad), for blaming a joint
_EXPLAINED = 40.0  # cost up to which the offset's size is reported: beyond it, feet have slid
# rad: largest distance from the fold, and from the other legs, of legs that nothing holds
_FOLDED, _APART = 0.9, 0.6
_CHECK = "check its sign and offset, or lay it on its belly with its legs folded"

Feet = list[list[LegPoint]]  # by observation and leg, m


class Observation(NamedTuple):
    """Observation with the trunk at rest: joint angles (rad), and the IMU's rotation (body to world)."""

    angles: Twelve
    rotation: Quaternion


class Hypothesis(NamedTuple):
    """One joint that is mirrored, or off by ``offset`` (rad); ``cost``: misfit of this explanation."""

    cost: float
    joint: int | None
    mirrored: bool
    offset: float


def explain(
    dog: DogDescription, looks: Sequence[Observation], joint: int | None, *, mirrored: bool = False
) -> Hypothesis:
    """Return the fit with this joint alone as the cause; None: with manufacturing errors alone."""
    errors, first = [_MADE] * _COUNT, [0.0] * _COUNT
    if joint is not None:
        errors[joint] = _FREE
    if joint is not None and mirrored:
        first[joint] = 2 * looks[0].angles[joint]
        looks = [_with_mirrored(look, joint) for look in looks]
    values, cost = first, 0.0
    for _ in range(_ROUNDS):
        residuals = _residuals(dog, looks, values)
        priors = [(value - start) / error for value, start, error in zip(values, first, errors, strict=True)]
        cost = sum(each * each for each in residuals) + sum(each * each for each in priors)
        slopes = []
        for number in range(_COUNT):
            moved = [value + _SMALL * (place == number) for place, value in enumerate(values)]
            after = _residuals(dog, looks, moved)
            slopes.append([(b - a) / _SMALL for a, b in zip(residuals, after, strict=True)])
        values = _improved(residuals, slopes, values, priors, errors)
    return Hypothesis(cost, joint, mirrored, 0.0 if joint is None else values[joint])


def _with_mirrored(look: Observation, joint: int) -> Observation:
    angles = tuple(-angle if number == joint else angle for number, angle in enumerate(look.angles))
    return look._replace(angles=angles)


def _residuals(dog: DogDescription, looks: Sequence[Observation], values: Sequence[float]) -> list[float]:
    """Return the residuals, each over its standard error: feet that move, feet above or below the floor."""
    slope_x, slope_y = values[_JOINTS : _JOINTS + 2]
    feet = [_feet(dog, look, values) for look in looks]
    stuck = [_centred(each) for each in _unrolled(dog, looks, feet)]
    means = [_mean([look[leg] for look in stuck]) for leg in range(len(LEGS))]
    found = []
    for look, stands in zip(stuck, feet, strict=True):
        for place, mean in zip(look, means, strict=True):
            found += [(a - b) / _STUCK for a, b in zip(place, mean, strict=True)]
        found += [(z - slope_x * x - slope_y * y) / _FOOT for x, y, z in _centred(stands)]
    return found


def _feet(dog: DogDescription, look: Observation, values: Sequence[float]) -> list[LegPoint]:
    """Return the feet of one observation relative to the trunk's centre, in the level frame."""
    angles = [angle + offset for angle, offset in zip(look.angles, values, strict=False)]
    mount_x, mount_y = values[_JOINTS + 2 :]
    feet = []
    for number, leg in enumerate(dog.legs):
        x, y, z = leg.foot((angles[3 * number], angles[3 * number + 1], angles[3 * number + 2]))
        x, y = x + leg.x, y + leg.y
        turned = (x + mount_y * z, y - mount_x * z, z + mount_x * y - mount_y * x)
        feet.append(to_world(look.rotation, turned))
    return feet


def _unrolled(dog: DogDescription, looks: Sequence[Observation], feet: Feet) -> Feet:
    """Return the feet minus the distance that they have rolled on the floor since the first observation."""
    radius, start = dog.geometry.foot_radius, _leans(looks[0])
    return [
        [
            (x - radius * (pitch - first_pitch), y + radius * (roll - first_roll), z)
            for (x, y, z), (roll, pitch), (first_roll, first_pitch) in zip(
                stands, _leans(look), start, strict=True
            )
        ]
        for look, stands in zip(looks, feet, strict=True)
    ]


def _leans(look: Observation) -> list[tuple[float, float]]:
    """Return roll and pitch of each calf in the level frame, rad."""
    imu = MeasuredImu(look.rotation, Vector3(), Vector3())
    angles = look.angles
    return [
        (imu.roll + angles[leg], imu.pitch + angles[leg + 1] + angles[leg + 2])
        for leg in range(0, _JOINTS, 3)
    ]


def _centred(points: Sequence[LegPoint]) -> list[LegPoint]:
    x, y, z = _mean(points)
    return [(a - x, b - y, c - z) for a, b, c in points]


def _mean(points: Sequence[LegPoint]) -> LegPoint:
    x, y, z = (sum(each) / len(points) for each in zip(*points, strict=True))
    return x, y, z


def _improved(
    residuals: list[float],
    slopes: list[list[float]],
    values: list[float],
    priors: list[float],
    errors: list[float],
) -> list[float]:
    """Return the values after one Gauss-Newton step."""
    matrix = [[sum(map(float.__mul__, one, two)) for two in slopes] for one in slopes]
    right = [-sum(map(float.__mul__, one, residuals)) for one in slopes]
    for number, error in enumerate(errors):
        matrix[number][number] += 1 / error**2
        right[number] -= priors[number] / error
    step = _solved(matrix, right)
    return [value + change for value, change in zip(values, step, strict=True)]


def _solved(matrix: list[list[float]], right: list[float]) -> list[float]:
    """Solve a symmetric, positive definite system by elimination; overwrites both arguments."""
    count = len(right)
    for pivot in range(count):
        for below in range(pivot + 1, count):
            share = matrix[below][pivot] / matrix[pivot][pivot]
            for column in range(pivot, count):
                matrix[below][column] -= share * matrix[pivot][column]
            right[below] -= share * right[pivot]
    found = [0.0] * count
    for row in reversed(range(count)):
        known = sum(matrix[row][column] * found[column] for column in range(row + 1, count))
        found[row] = (right[row] - known) / matrix[row][row]
    return found


def at_rest(dog: DogDescription, angles: Twelve) -> list[str]:
    """Return the joints that are not where they are on a robot that lies on its belly with folded legs."""
    fold, found = dog.posture(dog.poses.fold), []
    outward = [angle * leg.side if part == 0 else angle for leg, part, angle in _parts(dog, angles)]
    for number, (angle, folded) in enumerate(zip(angles, fold, strict=True)):
        others = sorted(outward[place] for place in range(number % 3, _JOINTS, 3) if place != number)
        apart = outward[number] - others[1]
        if abs(angle - folded) > _FOLDED:
            found.append(f"{JOINTS[number]}: is at {angle:.2f} rad, folded it is at {folded:.2f}; {_CHECK}")
        elif abs(apart) > _APART:
            found.append(
                f"{JOINTS[number]}: is {abs(apart):.2f} rad from where the other legs' are; {_CHECK}"
            )
    return found


def _parts(dog: DogDescription, angles: Twelve) -> Iterator[tuple[DogLeg, int, float]]:
    """Yield the leg, the number of the joint in it, and the angle of each joint."""
    for number, angle in enumerate(angles):
        yield dog.legs[number // 3], number % 3, angle


def problems(dog: DogDescription, looks: Sequence[Observation], ended: str = "") -> list[str]:
    """Return the joint errors that the observations of a check show; ``ended``: reason of an early end."""
    found = [f"the moves ended early: {ended}"] if ended else []
    if len(looks) < _LEAST:
        return found
    made = explain(dog, looks, None)
    guesses = [
        explain(dog, looks, joint, mirrored=mirrored)
        for joint in range(_JOINTS)
        for mirrored in (False, True)
    ]
    best = min(guesses, key=lambda guess: guess.cost)
    if made.cost < _UNLIKELY and (made.cost - best.cost < _BETTER or abs(best.offset) < _OFF):
        return found
    name = JOINTS[best.joint or 0]
    if best.mirrored or best.cost > _EXPLAINED:
        return [*found, f"{name}: its foot does not stay in place; jog it: most likely its sign is wrong"]
    wiring = dog.joints[name]
    right = wiring.offset - wiring.sign * best.offset
    hint = f"most likely its offset is {right:+.2f} (now {wiring.offset:+.2f})"
    return [*found, f"{name}: its foot is not where it should be; {hint}"]
