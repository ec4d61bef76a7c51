"""Simulated quadruped in physics: speed, tilt, falls, stops, recovery and cost, and its real-time loop.

The lock-step measurements are reproducible; the processor times are not.

python -m bench quadruped
python -m bench quadruped:cost,wanders      some rows of it
"""

from __future__ import annotations

import contextlib
import math
import random
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec

from bench import dog_loop
from bench.common import line
from fleet.runtime.interpreter import interpreter_settings
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.robot.description import EXAMPLE, DogDescription, load_description
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from fleet_quadruped.sim.tune import random_turn, tries_needed
from tests.tools.planted import as_built, checked, with_offset, with_sign
from tests.tools.wander import wander

SEEDS = 10  # each with its own friction and lost frames
WANDER_TIME = 20.0  # s
WANTED = (0.6, 0.2, 0.8)
COMMANDS = {
    "forward 0.6 m/s": Twist(0.6),
    "sideways 0.2 m/s": Twist(0, 0.2),
    "turn 0.8 rad/s": Twist(0, 0, 0.8),
}


def standing(dog: DogDescription, seed: int = 1, loss: float = 0.0) -> Rig:
    rig = Rig(dog, MujocoWorld(dog, friction=0.6 + 0.04 * seed), seed=seed)
    rig.stand()
    if loss:
        rig.sim.fault("loss", loss)
    return rig


def walk(rig: Rig, twist: Twist) -> tuple[float, float]:
    """Return the true speed (m/s or rad/s) and the greatest tilt (degrees)."""
    rig.go(1.5, twist)
    start, heading = rig.sim.world.place(), rig.sim.world.imu().rotation.yaw
    rig.go(2.5, twist)
    end, turned = rig.sim.world.place(), rig.sim.world.imu().rotation.yaw
    if twist.turn:
        return math.remainder(turned - heading, math.tau) / 2.5, math.degrees(rig.tilt)
    return math.dist(start[:2], end[:2]) / 2.5, math.degrees(rig.tilt)


def gaits(dog: DogDescription, seeds: int = SEEDS) -> None:
    for loss in (0.0, 0.05):
        rigs = [standing(dog, seed, loss) for seed in range(1, seeds + 1)]
        for (name, twist), wanted in zip(COMMANDS.items(), WANTED, strict=True):
            seen = [walk(rig, twist) for rig in rigs]
            speeds, tilts = [speed for speed, _ in seen], [tilt for _, tilt in seen]
            off = max(abs(speed - wanted) for speed in speeds) / wanted
            line(
                f"{dog.drive.protocol}, {loss:.0%} lost: {name}",
                f"{statistics.mean(speeds):.3f} ({min(speeds):.3f} to {max(speeds):.3f})",
                f"worst {off:.1%} off (aim 10 %), tilt {max(tilts):.1f} deg (aim 5)",
            )
            for rig in rigs:
                rig.go(1.5)
        down = sum(rig.sim.world.imu().tilt > 0.8 for rig in rigs)
        stopped = [rig.fault for rig in rigs if rig.fault]
        line("  fell; stopped by themselves", f"{down}/{seeds}; {len(stopped)}/{seeds}", *set(stopped[:1]))


def walks(dog: DogDescription, seeds: int = 4) -> None:
    """Print the speed, tilt and odometry of the gait ``walk`` at its highest velocities.

    The tilt of the first two cycles is separate from that of the three after them.
    """
    pace = dog.gait.walk
    for name, twist in {
        "forward": Twist(pace.speed),
        "backward": Twist(-pace.speed),
        "sideways": Twist(0, pace.strafe),
        "turn": Twist(0, 0, pace.turn),
    }.items():
        seen = [slow_walk(standing(dog, 2 * seed), twist) for seed in range(1, seeds + 1)]
        speeds, reported, first, later = zip(*seen, strict=True)
        wanted = twist.turn or abs(twist.x) + abs(twist.y)
        off = max(abs(speed - wanted) for speed in speeds) / wanted
        line(
            f"{dog.drive.protocol}, gait walk: {name} {wanted:g}",
            f"{min(speeds):.3f} to {max(speeds):.3f} (odometry {statistics.mean(reported):.3f})",
            f"worst {off:.1%} off, tilt {max(first):.1f} deg at first, {max(later):.1f} later (aim 5)",
        )


def slow_walk(rig: Rig, twist: Twist) -> tuple[float, float, float, float]:
    """Return true speed, odometry speed, and greatest tilt in the first two cycles and in the next three."""
    rig.order = msgspec.structs.replace(rig.order, gait="walk")
    period = rig.dog.gait.walk.period
    rig.go(2 * period, twist)
    first, begun = rig.tilt, place(rig)
    rig.go(3 * period, twist)
    moved = [
        math.remainder(end[2] - start[2], math.tau) if twist.turn else math.dist(start[:2], end[:2])
        for start, end in zip(begun, place(rig), strict=True)
    ]
    true, reported = (distance / (3 * period) for distance in moved)
    return true, reported, math.degrees(first), math.degrees(rig.tilt)


def place(rig: Rig) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the true pose and the odometry pose: x, y (m) and heading (rad)."""
    odometry, (x, y, _) = rig.controller.body.walker.odometry, rig.sim.world.place()
    return (x, y, rig.sim.world.imu().rotation.yaw), (odometry.x, odometry.y, odometry.yaw)


def wanders(dog: DogDescription, seeds: int = 24) -> None:
    """Print the falls of robots that follow random velocities and change them in mid-stride."""
    for gait in ("trot", "walk"):
        rigs = [standing(dog, 1 + seed % SEEDS) for seed in range(seeds)]
        tilts = [
            math.degrees(wander(rig, gait, random.Random(seed), WANDER_TIME)) for seed, rig in enumerate(rigs)
        ]
        fell = sum(bool(rig.fault) for rig in rigs)
        line(
            f"{dog.drive.protocol}, {gait}: fell or stopped, sent about at random for {WANDER_TIME:g} s each",
            f"{fell}/{seeds}",
            f"tilt {max(tilts):.1f} deg at the worst, {statistics.median(tilts):.1f} in the middle",
        )


def stops(dog: DogDescription) -> None:
    drops, peaks, cycles = [], [], []
    for phase in range(8):
        rig = standing(dog)
        rig.go(1.5 + phase * dog.gait.period / 8, Twist(0.5))
        falling: list[float] = []
        felt: list[float] = []
        speeds = [physics(rig).data.qvel[:3].tolist()]

        def watch(
            rig: Rig = rig,
            falling: list[float] = falling,
            felt: list[float] = felt,
            speeds: list[list[float]] = speeds,
        ) -> None:
            world = physics(rig)
            falling.append(world.fall_speed)
            now = world.data.qvel[:3].tolist()
            x, y, z = ((one - other) / rig.dog.dt for one, other in zip(now, speeds[-1], strict=True))
            speeds.append(now)
            felt.append(math.hypot(x, y, z + 9.81) / 9.81)

        rig.watch = watch
        rig.emergency()
        cycles.append(cycles_until_damped(rig))
        rig.go(2.0)
        drops.append(max(falling))
        peaks.append(max(felt))
    name = f"{dog.drive.protocol}: emergency stop in 8 phases of a trot"
    line(f"{name}: damped after", f"{max(cycles)} cycle", "aim: 1")
    line(
        "  speed of the drop; acceleration over a cycle",
        f"{max(drops):.2f} m/s; {max(peaks):.1f} g",
        "aim: 0.5 m/s; 4 g",
    )


def cycles_until_damped(rig: Rig) -> int:
    """Return the cycles from the order until every joint damps, or is held while the robot is lowered."""
    for number in range(1, 50):
        rig.cycle()
        if rig.is_compliant():
            return number - 1  # a frame written in one cycle takes effect in the next
    return 50


def stopped(rig: Rig) -> bool:
    """Return whether all drives have stopped on their own: in quick stop (CiA 402) or limp."""
    states = {getattr(drive, "state", DriveState.QUICK_STOP) for drive in rig.sim.drives}
    limp = all(motor.kp == 0 for motor in rig.sim.world.motors)
    return limp or (rig.dog.drive.protocol == "cia402" and states == {DriveState.QUICK_STOP})


def dies(dog: DogDescription) -> None:
    """Print how the drives react when the controller ends in mid-trot."""
    times, nearest = [], math.inf
    for phase in range(8):
        rig = standing(dog, seed=1 + phase)
        rig.go(1.5 + phase * dog.gait.period / 8, Twist(0.5))
        begun = rig.sim.time
        while not stopped(rig) and rig.sim.time - begun < 1.0:
            rig.sim.advance(0.002)
        times.append(rig.sim.time - begun)
        for _ in range(500):
            rig.sim.advance(0.002)
            for joint, motor in zip(dog.all_joints, rig.sim.world.motors, strict=True):
                nearest = min(nearest, motor.angle - joint.low, joint.high - motor.angle)
    line(f"{dog.drive.protocol}: controller dies in mid-trot: drives stop", f"{1000 * max(times):.0f} ms")
    line("  nearest that a joint came to a limit", f"{nearest:.3f} rad", "aim: none beyond")


def enables(dog: DogDescription) -> None:
    """Print the time until all twelve drives are reported enabled."""
    rig = Rig(dog)
    rig.go(0.1)
    begun = rig.sim.time
    rig.request(BodyRequest.STAND)
    while rig.mode is BodyMode.ENABLING:
        rig.cycle()
    line(
        f"{dog.drive.protocol}: 12 drives enabled",
        f"{1000 * (rig.sim.time - begun):.0f} ms",
        "aim: under 100 ms",
    )


def physics(rig: Rig) -> MujocoWorld:
    """Return the physics of a robot simulated by MuJoCo."""
    assert isinstance(rig.sim.world, MujocoWorld)
    return rig.sim.world


def repeats(dog: DogDescription, times: int = 20) -> None:
    """Print how many times in a row the robot stands up and sits down."""
    rig, done = standing(dog), 0
    while done < times and rig.mode is BodyMode.STANDING:
        rig.request(BodyRequest.SIT)
        rig.go(3.5)
        if rig.mode is BodyMode.OFF:
            rig.stand()
            done += 1
    line(f"{dog.drive.protocol}: sat down and stood up again", f"{done}/{times}", rig.fault)


def recoveries(dog: DogDescription, count: int = 60) -> None:
    rng = random.Random(99)
    tries = [tries_needed(dog, random_turn(rng), most=5) for _ in range(count)]
    up = sum(one is not None for one in tries)
    rolls = {number: tries.count(number) for number in range(6) if number in tries}
    line(
        f"{dog.drive.protocol}: recovery from random orientations",
        f"{up}/{count}",
        f"by rolls needed: {rolls}",
    )


def checks(dog: DogDescription, right: int = 50) -> None:
    """Print the findings of ``fleet can check --move``.

    Each joint's sign and offset are wrong in turn; correct robots with manufacturing tolerances follow.
    """
    wrong = [
        (name, with_offset(dog, name, offset)) for name in JOINTS for offset in (0.11, -0.11, 0.25, -0.25)
    ]
    wrong += [(name, with_sign(dog, name, calibrated=known)) for name in JOINTS for known in (True, False)]
    found = [checked(described, *as_built(dog, seed)) for seed, (_, described) in enumerate(wrong)]
    named = sum(name in "".join(lines) for lines, (name, _) in zip(found, wrong, strict=True))
    hits = sum(map(bool, found))
    line("one wrong sign or offset, all joints", f"{hits}/{len(wrong)} found", f"{named} by name (aim 95 %)")
    false = sum(bool(checked(dog, *as_built(dog, 1000 + seed))) for seed in range(right))
    line("right dogs, with the errors of manufacturing", f"{false}/{right} alarms", "aim: none")


def cost(dog: DogDescription) -> None:
    """Print the least processor use of a walking robot, and its breakdown.

    The whole of a cycle counts: frames both ways, controller, twelve drives, IMU, battery, physics. The
    adapter's part (reports, bus) is in the measurements of the processes.
    """
    rig = standing(dog)
    rig.go(1.5, Twist(0.5))
    windows = []
    with interpreter_settings(collect=False):
        for _ in range(60):
            used = dict.fromkeys(("take", "advance", "step"), 0.0)
            with timed(rig.sim, used, "take", "advance"), timed(rig.sim.world, used, "step"):
                begun = time.perf_counter()
                rig.go(0.42, Twist(0.5))
                used["all"] = time.perf_counter() - begun
            windows.append({name: seconds / 0.42 for name, seconds in used.items()})
        plain = min(_lasts(rig) for _ in range(60)) / 0.42
    best = min(windows, key=lambda used: used["all"])
    drives = best["take"] + best["advance"] - best["step"]
    controller = best["all"] - best["take"] - best["advance"]
    line(f"{dog.drive.protocol}: whole stack in lock-step, of a core", f"{plain:.1%}", "aim: 5 %")
    line("  controller; simulated drives; physics", f"{controller:.1%}; {drives:.1%}; {best['step']:.1%}")


def _lasts(rig: Rig) -> float:
    """Return the seconds that a step of each leg takes to compute."""
    begun = time.perf_counter()
    rig.go(0.42, Twist(0.5))
    return time.perf_counter() - begun


@contextlib.contextmanager
def timed(owner: object, used: dict[str, float], *names: str) -> Iterator[None]:
    """Accumulate the execution time of an object's methods, in seconds."""
    for name in names:
        setattr(owner, name, _measured(getattr(owner, name), used, name))
    try:
        yield
    finally:
        for name in names:
            delattr(owner, name)


def _measured(call: Callable[..., Any], used: dict[str, float], name: str) -> Callable[..., Any]:
    """Wrap a method so that its execution time is accumulated."""

    def measured(*given: object) -> Any:
        begun = time.perf_counter()
        try:
            return call(*given)
        finally:
            used[name] += time.perf_counter() - begun

    return measured


EACH: dict[str, Callable[[DogDescription], None]] = {
    "enables": enables,
    "gaits": gaits,
    "walks": walks,
    "wanders": wanders,
    "stops": stops,
    "dies": dies,
    "repeats": repeats,
    "cost": cost,
    "recoveries": recoveries,
}
ONCE: dict[str, Callable[[DogDescription], None]] = {
    "checks": checks,
    "loop": lambda _dog: dog_loop.run(),
}


def run(rows: Sequence[str] = ()) -> None:
    known = [*EACH, *ONCE]
    requested = rows or known
    for row in requested:
        if row not in known:
            sys.exit(f"there is no row {row!r}; there are {', '.join(known)}")
    dog = load_description(EXAMPLE)
    drive = dog.drive.model_copy(update={"protocol": "mit", "profile": "damiao-8006"})
    for each in (dog, dog.model_copy(update={"drive": drive})):
        for row, measure in EACH.items():
            if row in requested:
                measure(each)
    for row, measure in ONCE.items():
        if row in requested:
            measure(dog)
