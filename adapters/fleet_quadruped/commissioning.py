"""Signs and offsets of the joints, estimated from the small moves of ``fleet can check --move``.

The feet stay in place on a level floor while the trunk is shifted and tilted. With correct signs and offsets,
joints and IMU together put each foot at one place in all observations, and all feet on one plane. Least
squares finds the single mirrored or shifted joint that explains the observations best: this joint is free,
the offsets of all others are as small as manufacturing errors, the floor and the IMU are nearly level.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from operator import mul
from typing import NamedTuple

from fleet import Quaternion, Vector3
from fleet_quadruped.body.legs import DogLeg, LegPoint
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.body.vector_rotation import to_world
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import JOINTS, LEGS, Twelve

_FOOT = 0.0005  # m: standard error of a foot's height above the floor
_STUCK = 0.005  # m: standard error of a foot that stays in place
_MADE = 0.02  # rad: manufacturing errors of offsets and mounting angles
_FREE = 1.5  # rad: standard error of the offset of the joint under test
_ROUNDS = 5
_JOINTS = len(JOINTS)
_COUNT = _JOINTS + 4  # offsets; the floor's slopes along x and y; the IMU's mounting about x and y
_SMALL = 1e-4  # change of the values, rad, below which no more rounds are needed
_NOWHERE: LegPoint = (0.0, 0.0, 0.0)
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
    rolled = _rolled(dog, looks)
    values, cost = first, 0.0
    for _ in range(_ROUNDS):
        residuals, slopes = _linearized(dog, looks, rolled, values)
        priors = [(value - start) / error for value, start, error in zip(values, first, errors, strict=True)]
        cost = sum(map(mul, residuals, residuals)) + sum(map(mul, priors, priors))
        step = _step(residuals, slopes, priors, errors)
        values = [value + change for value, change in zip(values, step, strict=True)]
        if max(map(abs, step)) < _SMALL:
            break
    return Hypothesis(cost, joint, mirrored, 0.0 if joint is None else values[joint])


def _with_mirrored(look: Observation, joint: int) -> Observation:
    angles = tuple(-angle if number == joint else angle for number, angle in enumerate(look.angles))
    return look._replace(angles=angles)


def _linearized(
    dog: DogDescription, looks: Sequence[Observation], rolled: Feet, values: Sequence[float]
) -> tuple[list[float], list[list[float]]]:
    """Return the residuals, each over its standard error, and their derivatives by each value.

    The residuals are feet that move, and feet above or below the floor.
    """
    slope_x, slope_y, mount_x, mount_y = values[_JOINTS:]
    feet: Feet = []
    moved: list[Feet] = [[] for _ in range(_JOINTS)]
    tilted: list[Feet] = [[], []]
    for look in looks:
        angles = [angle + offset for angle, offset in zip(look.angles, values, strict=False)]
        stands: list[LegPoint] = []
        for number, leg in enumerate(dog.legs):
            first = 3 * number
            (x, y, z), columns = leg.reach((angles[first], angles[first + 1], angles[first + 2]))
            place = x + leg.x, y + leg.y, z
            stands.append(place)
            for joint, column in enumerate(columns, first):
                way = to_world(look.rotation, _tilted(column, mount_x, mount_y))
                moved[joint].append([way if other == number else _NOWHERE for other in range(len(LEGS))])
        feet.append([to_world(look.rotation, _tilted(place, mount_x, mount_y)) for place in stands])
        tilted[0].append([to_world(look.rotation, (0.0, -z, y)) for _, y, z in stands])
        tilted[1].append([to_world(look.rotation, (z, 0.0, -x)) for x, _, z in stands])
    centred = _centred(feet)
    unrolled = [
        [_less(foot, way) for foot, way in zip(stands, ways, strict=True)]
        for stands, ways in zip(centred, rolled, strict=True)
    ]
    level = [0.0] * (3 * len(LEGS) * len(looks))
    slopes = [_movement(each) + _unevenness(each, slope_x, slope_y) for each in map(_centred, moved)]
    slopes.append(level + [-x / _FOOT for stands in centred for x, _, _ in stands])
    slopes.append(level + [-y / _FOOT for stands in centred for _, y, _ in stands])
    slopes += [_movement(each) + _unevenness(each, slope_x, slope_y) for each in map(_centred, tilted)]
    return _movement(unrolled) + _unevenness(centred, slope_x, slope_y), slopes


def _tilted(place: LegPoint, mount_x: float, mount_y: float) -> LegPoint:
    """Return a place as a slightly tilted IMU has it."""
    x, y, z = place
    return x + mount_y * z, y - mount_x * z, z + mount_x * y - mount_y * x


def _movement(feet: Feet) -> list[float]:
    """Return how far each foot is from its mean place, over the standard error."""
    means = [_mean([stands[leg] for stands in feet]) for leg in range(len(LEGS))]
    found: list[float] = []
    for stands in feet:
        for (x, y, z), (mean_x, mean_y, mean_z) in zip(stands, means, strict=True):
            found += ((x - mean_x) / _STUCK, (y - mean_y) / _STUCK, (z - mean_z) / _STUCK)
    return found


def _unevenness(feet: Feet, slope_x: float, slope_y: float) -> list[float]:
    """Return how far each foot is above the floor, over the standard error."""
    return [(z - slope_x * x - slope_y * y) / _FOOT for stands in feet for x, y, z in stands]


def _rolled(dog: DogDescription, looks: Sequence[Observation]) -> Feet:
    """Return how far the feet have rolled on the floor since the first observation, from their centre."""
    radius, start = dog.geometry.foot_radius, _leans(looks[0])
    return _centred(
        [
            [
                (radius * (pitch - first_pitch), -radius * (roll - first_roll), 0.0)
                for (roll, pitch), (first_roll, first_pitch) in zip(_leans(look), start, strict=True)
            ]
            for look in looks
        ]
    )


def _leans(look: Observation) -> list[tuple[float, float]]:
    """Return roll and pitch of each calf in the level frame, rad."""
    imu = MeasuredImu(look.rotation, Vector3(), Vector3())
    angles, roll, pitch = look.angles, imu.roll, imu.pitch
    return [(roll + angles[leg], pitch + angles[leg + 1] + angles[leg + 2]) for leg in range(0, _JOINTS, 3)]


def _centred(feet: Feet) -> Feet:
    """Return the feet of each observation relative to their centre."""
    return [[_less(place, mean) for place in stands] for stands in feet for mean in [_mean(stands)]]


def _less(one: LegPoint, two: LegPoint) -> LegPoint:
    return one[0] - two[0], one[1] - two[1], one[2] - two[2]


def _mean(points: Sequence[LegPoint]) -> LegPoint:
    x, y, z = map(sum, zip(*points, strict=True))
    count = len(points)
    return x / count, y / count, z / count


def _step(
    residuals: list[float], slopes: list[list[float]], priors: list[float], errors: list[float]
) -> list[float]:
    """Return the changes of the values in one Gauss-Newton step."""
    right = [
        -sum(map(mul, one, residuals)) - prior / error
        for one, prior, error in zip(slopes, priors, errors, strict=True)
    ]
    matrix = [[0.0] * _COUNT for _ in range(_COUNT)]
    for row, one in enumerate(slopes):
        for column in range(row + 1):
            matrix[row][column] = matrix[column][row] = sum(map(mul, one, slopes[column]))
        matrix[row][row] += 1 / errors[row] ** 2
    return _solved(matrix, right)


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
