"""Changes of the robots of a worker: what is stricter at once, and the rest by a restart."""

import json

import pytest

from fleet.config.load import Loaded
from fleet.config.schema import FleetConfig
from fleet.host.edge.worker_file_changes import WorkerFileChanges
from fleet.model.change import Change, ChangeKind, HeldRobot, HoldRobot, Outcome
from fleet.plugins.registry import Plugin, Registry
from fleet.robot_config import AdapterConfig

ARM = {"name": "arm", "twin": "6f0c9a1e-0000-4000-8000-000000000001", "worker": "limbs"}
LEG = {"name": "leg", "twin": "6f0c9a1e-0000-4000-8000-000000000002", "worker": "limbs"}
REX = {"name": "rex", "twin": "6f0c9a1e-0000-4000-8000-000000000003"}
WAITS = "what is stricter holds from now on; the rest waits until it rests: "
BUSY = (Outcome.REFUSED, "leg is commanded")


def loaded(tmp_path, *robots):
    """Return a loaded file of some robots, each a dictionary."""
    configs = [(AdapterConfig(**robot), Plugin("toy", "toy.py")) for robot in robots]
    config = FleetConfig(edge={"id": "yard"}, robots=()).model_copy(
        update={"robots": tuple(robot for robot, _ in configs)}
    )
    given = {robot["name"]: json.dumps(robot) for robot in robots}
    return Loaded(config, Registry([]), tuple(configs), tmp_path, given)


class Remote:
    """A robot in a worker, as the edge knows it."""

    config = None

    def configure(self, config):
        self.config = config


class Workers:
    """Workers that answer ``held``, and end a restart as told; all that they are asked is kept."""

    def __init__(self, held=None, outcome=(Outcome.DONE, "")):
        self.held, self.outcome = held or {}, outcome
        self.wanted, self.restarts, self.next = {}, [], None

    async def hold(self, worker, robots):
        assert worker == "limbs"
        self.wanted = robots
        return self.held

    async def change(self, worker, after, *, force):
        self.restarts.append((worker, after, force))
        return self.outcome

    def runs_with(self, worker, after):
        self.next = after


class Bench:
    """An edge with arm and leg in one worker, whose file changes."""

    def __init__(self, folder, workers):
        self.folder, self.workers = folder, workers
        self.remote = {"arm": Remote(), "leg": Remote()}
        self.running = loaded(folder, ARM, LEG, REX)

    async def carry_out(self, *changed, kind=ChangeKind.SETTINGS, force=False):
        """Carry the changes of some robots out; return the outcomes by name."""
        fields = {one["name"]: one for one in (ARM, LEG, REX)} | {one["name"]: one for one in changed}
        self.new = loaded(self.folder, *fields.values())
        changes = WorkerFileChanges(self.workers, self.remote)
        wanted = (Change(one["name"], kind) for one in changed)
        self.after, ends = await changes.carry_out("limbs", wanted, self.running, self.new, force=force)
        return {end.name: (end.outcome, end.why) for end in ends}

    def limits(self, name):
        """Return the speed limit of a robot afterwards, by the running configuration and by its robot."""
        (config,) = [robot for robot, _ in self.after.robots if robot.name == name]
        own = self.remote[name].config
        return config.limits.speed, own and own.limits.speed


@pytest.fixture
def bench(tmp_path):
    return lambda *arguments: Bench(tmp_path, Workers(*arguments))


def slow(robot, speed=0.5):
    return robot | {"limits": {"speed": speed}}


async def test_settings_that_the_worker_holds_as_a_whole_need_no_restart(bench):
    yard = bench({"arm": HeldRobot(complete=True)})
    assert await yard.carry_out(slow(ARM)) == {"arm": (Outcome.DONE, "")}
    assert (yard.workers.restarts, yard.workers.next) == ([], yard.after)
    assert (yard.limits("arm"), yard.limits("leg")) == ((0.5, 0.5), (None, None))
    assert json.loads(yard.after.given["arm"]) == slow(ARM)


@pytest.mark.parametrize(
    ("kind", "whole"), [(ChangeKind.SETTINGS, True), (ChangeKind.REBUILT, False), (ChangeKind.ADDED, False)]
)
async def test_the_worker_may_use_all_of_a_change_only_if_the_adapter_can_go_on(bench, kind, whole):
    yard = bench()
    await yard.carry_out(slow(ARM), kind=kind)
    assert yard.workers.wanted == {"arm": HoldRobot(json.dumps(slow(ARM)), whole=whole)}


async def test_one_robot_that_is_not_held_as_a_whole_restarts_the_worker_for_all(bench):
    yard = bench({"arm": HeldRobot(complete=True), "leg": HeldRobot(changed=True)})
    assert await yard.carry_out(slow(ARM), slow(LEG)) == dict.fromkeys(("arm", "leg"), (Outcome.DONE, ""))
    ((worker, after, force),) = yard.workers.restarts
    assert (worker, after, force) == ("limbs", yard.after, False)
    assert (yard.limits("arm"), yard.limits("leg")) == ((0.5, 0.5), (0.5, 0.5))


async def test_a_robot_of_which_the_worker_says_nothing_is_not_taken_for_held(bench):
    yard = bench({"arm": HeldRobot(complete=True)})
    await yard.carry_out(slow(ARM), slow(LEG))
    assert len(yard.workers.restarts) == 1


async def test_a_restart_that_failed_leaves_the_configuration_of_before(bench):
    yard = bench({}, (Outcome.FAILED, "arm did not answer"))
    assert await yard.carry_out(slow(ARM)) == {"arm": (Outcome.FAILED, "arm did not answer")}
    assert (yard.after, yard.remote["arm"].config) == (yard.running, None)


async def test_a_worker_that_goes_on_with_the_new_one_though_a_robot_is_away_has_changed(bench):
    yard = bench({}, (Outcome.PARTLY, "arm did not answer"))
    assert await yard.carry_out(slow(ARM)) == {"arm": (Outcome.PARTLY, "arm did not answer")}
    assert yard.limits("arm") == (0.5, 0.5)


async def test_each_robot_of_a_worker_that_goes_on_has_what_it_is_held_to(bench):
    held = {
        "arm": HeldRobot(complete=True),
        "leg": HeldRobot(changed=True, settings='{"limits": {"speed": 0.7}}'),
    }
    yard = bench(held, BUSY)
    ends = await yard.carry_out(slow(ARM), slow(LEG, 0.6) | {"role": "leader"})
    assert ends == {"arm": (Outcome.DONE, ""), "leg": (Outcome.PARTLY, f"{WAITS}leg is commanded")}
    assert (yard.limits("arm"), yard.limits("leg")) == ((0.5, 0.5), (0.7, 0.7))
    assert json.loads(yard.after.given["leg"]) == slow(LEG, 0.7)
    assert yard.workers.next is yard.after


async def test_robots_that_are_held_to_nothing_keep_their_configuration_and_say_why(bench):
    yard = bench({"leg": HeldRobot(why="its adapter, as it is loaded, refuses it")}, BUSY)
    ends = await yard.carry_out(slow(ARM), slow(LEG))
    assert ends == {
        "arm": BUSY,
        "leg": (Outcome.REFUSED, "leg is commanded; its adapter, as it is loaded, refuses it"),
    }
    assert (yard.after is yard.running, yard.workers.next) == (True, None)
    assert {robot.config for robot in yard.remote.values()} == {None}


FORCED = [
    # speed before and after (m/s), whether the restart is forced
    (1.0, 0.5, True),
    (0.5, 1.0, False),
    (None, 1.0, False),  # the adapter's own limit is not known to the edge
    (1.0, None, False),
]


@pytest.mark.parametrize(("before", "after", "forced"), FORCED)
async def test_force_does_not_loosen_a_robot_that_may_move(bench, before, after, forced):
    yard = bench({}, BUSY)
    yard.running = loaded(yard.folder, slow(ARM, before) if before else ARM, LEG, REX)
    ends = await yard.carry_out(slow(ARM, after) if after else ARM, force=True)
    assert [force for *_, force in yard.workers.restarts] == [forced]
    held_back = "" if forced else "; what holds arm back is not loosened in motion"
    assert ends == {"arm": (Outcome.REFUSED, f"leg is commanded{held_back}")}


async def test_without_force_nothing_is_said_of_what_is_looser(bench):
    yard = bench({}, BUSY)
    assert await yard.carry_out(slow(ARM, 3.0)) == {"arm": BUSY}
