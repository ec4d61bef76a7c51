"""The search for the poses with which a dog rolls onto its feet: its trials, its score, and its output."""

import random
from types import SimpleNamespace

import pytest

from fleet import quaternion_from_euler
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.robot.description import EXAMPLE, load_description
from fleet_quadruped.robot.parts import LegPose
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim import tune
from fleet_quadruped.sim.world import SimMotor

DOG = load_description(EXAMPLE)
TRIALS = 12
UPSIDE_DOWN = quaternion_from_euler(3.0, 0.0, 0.0)


class World:
    """A world that keeps how the dog was dropped."""

    def __init__(self, dog=DOG):
        self.motors = [SimMotor(kp=9.0, kd=9.0) for _ in range(12)]
        self.done = []

    def put(self, turn, height):
        assert {(motor.kp, motor.kd) for motor in self.motors} == {(0.0, 1.0)}, "it is limp"
        self.done.append((turn, height))

    def step(self, dt):
        self.done.append(dt)

    def measure(self):
        self.done.append("measured")


def test_a_random_orientation_is_one_and_comes_again_with_its_seed():
    turns = [tune.random_turn(random.Random(seed)) for seed in (1, 1, 2)]
    assert turns[0] == turns[1] != turns[2]
    for turn in turns:
        assert turn.w**2 + turn.x**2 + turn.y**2 + turn.z**2 == pytest.approx(1.0)


def test_a_dog_is_dropped_limp_from_half_a_metre_and_comes_to_rest():
    world = World()
    tune.drop(world, UPSIDE_DOWN)
    assert world.done == [(UPSIDE_DOWN, 0.5), *[0.01] * 100, "measured"]


class Dropped:
    """A dog that rolls ``rolls`` times before it is ``then``; ``refusal``: of its recovery."""

    rolls, then, refusal = 2, BodyMode.STANDING, ""

    def __init__(self, dog, world):
        self.mode, self.cycles = BodyMode.OFF, 0
        self.controller = SimpleNamespace(body=SimpleNamespace(recovery=SimpleNamespace(tries=0)))

    def go(self, seconds):
        assert seconds == 0.1, "its drives are heard first"

    def request(self, request):
        assert request is BodyRequest.RECOVER
        self.mode = BodyMode.ENABLING
        return self.refusal

    def cycle(self):
        self.cycles += 1
        assert self.cycles < 99
        recovery = self.controller.body.recovery
        if recovery.tries == self.rolls:
            self.mode = BodyMode.RISING if self.mode is BodyMode.RECOVERING else self.then
        else:
            self.mode, recovery.tries = BodyMode.RECOVERING, recovery.tries + 1


@pytest.fixture
def dropped(monkeypatch):
    monkeypatch.setattr(tune, "MujocoWorld", World)
    monkeypatch.setattr(tune, "Rig", type("Rig", (Dropped,), {}))
    return tune.Rig


@pytest.mark.parametrize(("rolls", "most", "found"), [(1, 3, 1), (3, 3, 3), (4, 3, None), (2, 1, None)])
def test_the_rolls_are_counted_until_it_stands(dropped, rolls, most, found):
    dropped.rolls = rolls
    assert tune.tries_needed(DOG, UPSIDE_DOWN, most) == found


def test_a_dog_that_gives_way_or_may_not_recover_does_not_stand(dropped):
    dropped.then = BodyMode.DAMPED
    assert tune.tries_needed(DOG, UPSIDE_DOWN) is None
    dropped.refusal = "it needs help"
    assert tune.tries_needed(DOG, UPSIDE_DOWN) is None


def test_poses_are_put_into_the_description_and_nothing_else():
    near, far = LegPose(abad=0.1, hip=0.2, knee=-1.0), LegPose(abad=0.3, hip=0.4, knee=-1.2)
    found = tune.with_roll(DOG, near, far)
    assert (found.poses.roll_near, found.poses.roll_far) == (near, far)
    assert (found.poses.fold, found.safety) == (DOG.poses.fold, DOG.safety)


class Trials:
    """Whether each trial of each pose is mastered, and how often they were tried."""

    def __init__(self, monkeypatch, masters):
        self.poses, self.tried, self._masters = [], 0, masters
        monkeypatch.setattr(tune, "tries_needed", self._try)

    def _try(self, dog, turn, most):
        assert most == 2
        if not self.poses or self.poses[-1] != dog.poses.roll_near:
            self.poses.append(dog.poses.roll_near)
            self.number = 0
        self.tried += 1
        self.number += 1
        return 1 if self._masters(len(self.poses), self.number) else None


def test_the_pose_that_masters_most_orientations_is_found(monkeypatch):
    trials = Trials(monkeypatch, lambda pose, number: number <= (3, 8, 5)[pose - 1])
    near, _, score = tune.search(DOG, 3)
    assert (near, score) == (trials.poses[1], 8)


def test_the_first_of_two_that_are_as_good_is_kept(monkeypatch):
    trials = Trials(monkeypatch, lambda pose, number: number <= 6)
    assert tune.search(DOG, 3)[0] == trials.poses[0]


def test_a_search_ends_when_all_orientations_are_mastered(monkeypatch):
    trials = Trials(monkeypatch, lambda pose, number: True)
    assert (tune.search(DOG, 50)[2], len(trials.poses), trials.tried) == (TRIALS, 1, TRIALS)


def test_a_pose_that_fails_on_the_back_is_not_tried_further(monkeypatch):
    trials = Trials(monkeypatch, lambda pose, number: number > 1)
    assert (tune.search(DOG, 4)[2], trials.tried) == (0, 4)


def test_a_pose_that_cannot_be_the_best_any_more_is_given_up(monkeypatch):
    trials = Trials(monkeypatch, lambda pose, number: number <= (10, 2)[pose - 1])
    assert tune.search(DOG, 2)[2] == 10
    assert trials.tried == TRIALS + 4  # two of twelve are lost with the fourth


def test_every_pose_is_within_the_limits_of_the_joints(monkeypatch):
    trials = Trials(monkeypatch, lambda pose, number: False)
    tune.search(DOG, 30)
    for pose in trials.poses:
        for part in ("abad", "hip", "knee"):
            low, high = DOG.actuators[part].limits
            assert low + DOG.safety.margin <= getattr(pose, part) <= high - DOG.safety.margin


def test_the_same_seed_finds_the_same_poses(monkeypatch):
    Trials(monkeypatch, lambda pose, number: True)
    assert tune.search(DOG, 1) == tune.search(DOG, 1)
    assert tune.search(DOG, 1, seed=2) != tune.search(DOG, 1)


def test_the_poses_are_printed_as_they_stand_in_a_description(monkeypatch, capsys):
    near, far = LegPose(abad=0.1, hip=0.2, knee=-1.0), LegPose(abad=0.3, hip=0.4, knee=-1.2)
    asked = []
    monkeypatch.setattr(
        tune, "search", lambda dog, rounds: asked.append((dog.robot.name, rounds)) or (near, far, 9)
    )
    assert tune.main([str(EXAMPLE), "--rounds", "7"]) == 0
    assert asked == [("example", 7)]
    assert capsys.readouterr().out == (
        "  roll_near: {abad: 0.1, hip: 0.2, knee: -1.0}\n"
        "  roll_far: {abad: 0.3, hip: 0.4, knee: -1.2}\n"
        "  # 9 of 12 trial orientations\n"
    )
