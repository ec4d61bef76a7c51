"""Roll-out to a hundred fake edges, some of which fail: it stops in time, and nothing is half applied."""

import contextlib
import random

import msgspec
import pytest

from fleet.rollout.agent import Agent
from fleet.rollout.bundle import BundleError, sign_bundle
from fleet.rollout.decision import AgentRecord
from fleet.rollout.driver import SILENT_FOR, Driver, RolloutMissing, RolloutRunning
from fleet.rollout.edge_here import ApplyResult
from fleet.rollout.installation import Installation
from fleet.rollout.messages import BundleStage
from fleet.rollout.signature import by_name, new_key
from fleet.rollout.store import StoreError
from fleet.rollout.waves import EdgeStatus, RolloutPhase
from fleet.testing.clock import ManualClock
from tests.tools.rollout import FakeEdge, MemoryStore, bundle_of, rollout_of

KEY = new_key()
EDGES = tuple(f"edge-{number:03}" for number in range(100))
FAILS = {
    "it does not start": {"refuses": {b"version 2": BundleError("the file cannot be used")}},
    "a robot does not come back": {"outcomes": [ApplyResult(failed="rex: it does not answer")]},
}


class Fleet:
    """A hundred fake edges with real agents and folders, and the driver of a roll-out to them."""

    def __init__(self, folder, edges=EDGES):
        self.store, self.clock = MemoryStore(), ManualClock()
        self.old, _ = sign_bundle(bundle_of(1, edges), KEY)
        self.new, data = sign_bundle(bundle_of(2, edges), KEY)
        self.store.bundles[self.new] = data
        self.edges = {}
        for name in edges:
            installation = Installation(folder / name)
            installation.folder.mkdir()
            installation.stage(bundle_of(1, edges), self.old)
            installation.save_record(AgentRecord(self.old, 1, self.old))
            installation.activate(self.old)
            here = FakeEdge(installation)
            agent = Agent(
                name,
                installation,
                by_name([KEY.public]),
                self.store.edge(name),
                here,
                clock=self.clock,
                sleep=self.sleep,
            )
            self.edges[name] = (agent, here)
        self.driver = self.driven()

    def driven(self):
        return Driver(self.store, clock=self.clock, sleep=self.sleep)

    async def sleep(self, seconds):
        """Advance the clock; each agent polls the store once."""
        self.clock.advance(seconds)
        for agent, _ in self.edges.values():
            if agent.record.rollout or agent._edge in self.store.desired_of:
                await agent.poll()

    def fails(self, names, **how):
        for name in names:
            for field, value in how.items():
                setattr(self.edges[name][1], field, value.copy())

    async def begin(self, **options):
        await self.driver.begin(rollout_of(dict.fromkeys(self.edges, self.new), **options))

    async def roll_out(self, **options):
        await self.begin(**options)
        return (await self.driver.drive()).progress

    async def settle(self):
        """Let every agent settle."""
        for _ in range(5):
            await self.sleep(1.0)

    def running(self):
        """Return old or new for each edge, after checking that its link, last apply and record agree."""
        found = {}
        for name, (agent, here) in self.edges.items():
            content = agent._installation.file_in_use.read_bytes()
            assert not here.applied or here.applied[-1] == content, f"{name} runs with something else"
            assert agent.record.stage not in (
                BundleStage.TAKING,
                BundleStage.WAITING,
                BundleStage.RETURNING,
            ), name
            assert agent._installation.current == agent.record.running, name
            found[name] = "new" if agent.record.running == self.new else "old"
        return found


@pytest.fixture
def edges():
    """Name the edges of the fleet; a test whose numbers need no hundred takes fewer."""
    return EDGES


@pytest.fixture
def fleet(tmp_path, monkeypatch, edges):
    # No power is cut here, and to write a thousand files through to the disk takes seconds.
    monkeypatch.setattr("fleet.rollout.installation.os.fsync", lambda _file: None)
    return Fleet(tmp_path, edges)


async def test_a_good_bundle_reaches_every_edge(fleet):
    progress = await fleet.roll_out()
    assert progress.phase is RolloutPhase.COMPLETED
    assert set(fleet.running().values()) == {"new"}


@pytest.mark.parametrize("how", FAILS)
@pytest.mark.parametrize("seed", range(3))
async def test_with_five_of_a_hundred_that_fail_it_stops_in_time(fleet, how, seed):
    failing = set(random.Random(seed).sample(EDGES, 5))
    fleet.fails(failing, **FAILS[how])
    progress = await fleet.roll_out(parallel=5, stop_if="failed > 2%")
    await fleet.settle()
    assert progress.phase is RolloutPhase.STOPPED
    failed = [name for name, status in progress.statuses.items() if status is EdgeStatus.FAILED]
    assert failed
    assert set(failed) <= failing
    assert len(failed) - 1 <= 0.02 * len(progress.statuses) + 5, (
        "at most those under way fail beyond the limit"
    )
    running = fleet.running()
    assert all(running[name] == "old" for name in failing)
    assert all(running[name] == "old" for name in EDGES if name not in progress.statuses)
    assert all(
        running[name] == "new" for name, status in progress.statuses.items() if status is EdgeStatus.DONE
    )


@pytest.mark.parametrize("how", FAILS)
async def test_a_bundle_that_no_edge_can_use_stops_in_the_first_wave(fleet, how):
    fleet.fails(EDGES, **FAILS[how])
    progress = await fleet.roll_out()
    assert (progress.phase, list(progress.statuses)) == (RolloutPhase.STOPPED, ["edge-000"])
    assert set(fleet.running().values()) == {"old"}


async def test_edges_that_wait_when_it_stops_roll_back(fleet):
    waits = ApplyResult(waits="rex: it is armed; disarm it first")
    fleet.fails(["edge-003"], outcomes=[waits] * 50)
    fleet.fails(["edge-005"], outcomes=[ApplyResult(failed="rex: it does not answer")])
    progress = await fleet.roll_out(stop_if="failed > 0")
    fleet.edges["edge-003"][1].outcomes = []
    await fleet.settle()
    assert progress.phase is RolloutPhase.STOPPED
    assert fleet.running()["edge-003"] == "old"
    assert fleet.edges["edge-003"][0].record.stage is BundleStage.WITHDRAWN


async def test_a_wave_waits_for_a_robot_in_flight_until_its_time_is_over(fleet):
    fleet.fails(["edge-000"], outcomes=[ApplyResult(waits="rex: it is armed")] * 500)
    progress = await fleet.roll_out(within=30.0)
    assert (progress.phase, list(progress.statuses)) == (RolloutPhase.STOPPED, ["edge-000"])


async def test_an_edge_that_comes_back_when_it_is_overdue_installs_nothing(fleet):
    agent, here = fleet.edges.pop("edge-000")
    fleet.store.observed_of.pop("edge-000", None)
    await fleet.driver.begin(rollout_of(dict.fromkeys(EDGES, fleet.new), within=30.0))
    progress = (await fleet.driver.drive()).progress
    assert (progress.phase, progress.statuses) == (RolloutPhase.STOPPED, {"edge-000": EdgeStatus.OVERDUE})
    await agent.poll()
    assert (agent.record.running, here.applied) == (fleet.old, [])


async def test_an_overdue_edge_rolls_back_while_the_roll_out_continues(fleet):
    fleet.fails(["edge-000"], outcomes=[ApplyResult(waits="rex: it is armed")] * 35)
    progress = await fleet.roll_out(within=30.0, stop_if="failed > 5")
    await fleet.settle()
    assert (progress.phase, progress.statuses["edge-000"]) == (RolloutPhase.COMPLETED, EdgeStatus.OVERDUE)
    assert fleet.running()["edge-000"] == "old"
    assert fleet.edges["edge-000"][0].record.stage is BundleStage.WITHDRAWN


@pytest.mark.parametrize("how", ["it is aborted again", "another one begins"])
async def test_withdrawals_are_written_again_after_an_interrupted_end(fleet, how):
    fleet.fails(EDGES, outcomes=[ApplyResult(waits="rex: it is armed")])
    await fleet.begin(waves="10,100%")
    await fleet.driver.poll()
    await fleet.sleep(1.0)
    put_desired = fleet.store.put_desired

    async def cut_off(edge, desired):
        raise Detached

    fleet.store.put_desired = cut_off
    with pytest.raises(Detached):
        await fleet.driven().abort("bob")
    fleet.store.put_desired = put_desired
    if how == "it is aborted again":
        assert (await fleet.driven().abort("eve")).progress.why == "aborted by bob"
    else:
        other = rollout_of({"edge-099": fleet.new})
        await fleet.driven().begin(msgspec.structs.replace(other, id="r2"))
    await fleet.settle()
    assert set(fleet.running().values()) == {"old"}


class Detached(Exception):
    """Ctrl-C."""


@pytest.mark.parametrize("edges", [EDGES[:20]], ids=["twenty"])
@pytest.mark.parametrize("after", [1, 2, 4, 7])
async def test_after_a_driver_detaches_another_one_drives_to_the_end(fleet, after):
    await fleet.begin(parallel=5)
    calls = 0
    keep = fleet.store.replace_rollout

    async def cut_off(rollout, revision):
        nonlocal calls
        calls += 1
        kept = await keep(rollout, revision)
        if calls == after:
            raise Detached  # after the step was stored, before the desired states were written
        return kept

    fleet.store.replace_rollout = cut_off
    with contextlib.suppress(Detached):
        await fleet.driver.drive()
    fleet.store.replace_rollout = keep
    before = len((await fleet.store.rollout())[0].progress.statuses)
    await fleet.settle()
    assert len((await fleet.store.rollout())[0].progress.statuses) == before, "nobody else is told meanwhile"
    assert (await fleet.driven().drive()).progress.phase is RolloutPhase.COMPLETED
    assert set(fleet.running().values()) == {"new"}


async def test_an_abort_rolls_back_edges_that_are_not_done(fleet):
    fleet.fails(EDGES, outcomes=[ApplyResult(waits="rex: it is armed")])
    await fleet.begin(waves="10,100%")
    await fleet.driver.poll()
    await fleet.sleep(1.0)
    ended = await fleet.driven().abort("bob")
    await fleet.settle()
    assert (ended.progress.phase, ended.progress.why) == (RolloutPhase.ABORTED, "aborted by bob")
    assert set(fleet.running().values()) == {"old"}
    assert (await fleet.driven().abort("eve")).progress.why == "aborted by bob"


@pytest.mark.parametrize("edges", [EDGES[:20]], ids=["twenty"])
async def test_only_one_roll_out_and_one_driver_at_a_time(fleet):
    await fleet.begin()
    with pytest.raises(RolloutRunning, match="roll-out r1 of alice is under way"):
        await fleet.begin()
    other = fleet.driven()
    first = fleet.store.rollout

    async def then_another_steps():
        found = await first()
        fleet.store.rollout = first
        await other.poll()
        return found

    fleet.store.rollout = then_another_steps
    with pytest.raises(StoreError, match="changed meanwhile"):
        await fleet.driver.poll()


@pytest.mark.parametrize("edges", [EDGES[:20]], ids=["twenty"])
async def test_one_lost_answer_of_the_store_does_not_end_the_driver(fleet):
    await fleet.begin()
    put_desired, lost = fleet.store.put_desired, []

    async def loses_the_first(edge, desired):
        if not lost:
            lost.append(edge)
            raise StoreError("the store of roll-outs does not answer")
        await put_desired(edge, desired)

    fleet.store.put_desired = loses_the_first
    assert (await fleet.driver.drive()).progress.phase is RolloutPhase.COMPLETED
    assert set(fleet.running().values()) == {"new"}


@pytest.mark.parametrize("edges", [EDGES[:20]], ids=["twenty"])
async def test_a_store_that_stays_silent_ends_the_driver_with_advice_to_resume(fleet):
    await fleet.begin()
    fleet.store.silent = True
    with pytest.raises(StoreError, match="does not answer; continue with: fleet rollout resume"):
        await fleet.driver.drive()
    assert fleet.clock.monotonic() >= SILENT_FOR


async def test_without_a_roll_out_there_is_nothing_to_drive():
    with pytest.raises(RolloutMissing, match="fleet apply --fleet"):
        await Driver(MemoryStore(), clock=ManualClock()).drive()


async def test_a_report_of_an_old_roll_out_is_ignored(fleet):
    await fleet.roll_out()
    wanted = rollout_of(dict.fromkeys(EDGES, fleet.new))
    await fleet.driver.begin(msgspec.structs.replace(wanted, id="r2"))
    rollout, _ = await fleet.driver.poll()
    assert rollout.progress.statuses == {"edge-000": EdgeStatus.OPEN}
    rollout, _ = await fleet.driver.poll()
    assert rollout.progress.statuses == {"edge-000": EdgeStatus.OPEN}
