"""Agent of an edge: accepted bundles, refusals, rollbacks."""

import asyncio
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import Refused
from fleet.rollout.bundle import HEAD, LARGEST, BundleError
from fleet.rollout.edge_here import ApplyResult, Code, Running
from fleet.rollout.faults import PartFault
from fleet.rollout.messages import SETTLED, BundleStage, DesiredState
from fleet.rollout.signature import new_key
from tests.tools.rollout import desired_of
from tests.tools.rollout_yard import KEY, Yard

MOVES = ApplyResult(("rex: rebuilt: refused",), waits="rex: it is armed; disarm it first")


@pytest.fixture
def yard(tmp_path):
    return Yard(tmp_path)


async def test_a_new_bundle_is_installed_applied_and_reported(yard):
    address = await yard.want(2)
    report = await yard.report()
    assert (report.stage, report.bundle, report.running) == (BundleStage.DONE, address, address)
    assert report.lines == ("rex: settings only: done",)
    assert yard.here.applied == [b"version 2 "]
    await yard.agent.poll()
    assert len(yard.here.applied) == 1, "what is done is done once"


async def test_a_change_of_a_flying_robot_is_reported_as_waiting_until_it_rests(yard):
    yard.here.outcomes = [MOVES, MOVES]
    await yard.want(2)
    assert ((await yard.report()).stage, (await yard.report()).why) == (BundleStage.WAITING, MOVES.waits)
    await yard.agent.poll()
    await yard.agent.poll()
    assert (await yard.report()).stage is BundleStage.DONE
    assert len(yard.here.applied) == 3


@pytest.mark.parametrize(
    "outcome",
    [ApplyResult(failed="rex: it does not answer"), Refused("edge yard-1: another change is under way")],
)
async def test_a_bundle_that_fails_is_rolled_back(yard, outcome):
    yard.here.outcomes = [outcome]
    await yard.want(2)
    report = await yard.report()
    assert (report.stage, report.running) == (BundleStage.FAILED, yard.first)
    assert yard.here.applied == [b"version 2 ", b"version 1 "]


async def test_an_unusable_fleet_file_changes_nothing(yard):
    yard.here.refuses = {b"broken": BundleError("fleet.yaml:1:1: robots: there are none")}
    await yard.want(2, text="broken")
    report = await yard.report()
    assert (report.stage, report.running) == (BundleStage.FAILED, yard.first)
    assert "robots: there are none" in report.why
    assert yard.here.applied == []
    assert yard.text == "version 1"


async def test_an_edge_that_gets_less_healthy_rolls_back(yard):
    def gets_worse(by):
        content = yard.installation.file_in_use.read_bytes()
        faults = (PartFault("rex", "fault", "motor 3"),) if b"version 2" in content else ()
        yard.here.state = Running("degraded" if faults else "ok", "", 0.0, faults)
        return ApplyResult()

    yard.here.apply = gets_worse
    await yard.want(2, settle=3.0)
    report = await yard.report()
    assert (report.stage, yard.text) == (BundleStage.FAILED, "version 1")
    assert report.why == "rex is fault, was ok: motor 3"


async def test_a_rollback_that_has_to_wait_continues_until_it_is_complete(yard):
    yard.here.outcomes = [ApplyResult(failed="rex: no answer"), MOVES]
    await yard.want(2)
    assert (await yard.report()).stage is BundleStage.RETURNING
    assert yard.text == "version 1"
    await yard.agent.poll()
    report = await yard.report()
    assert (report.stage, report.why) == (BundleStage.FAILED, "rex: no answer")


async def test_a_roll_out_that_ends_while_a_robot_moves_is_withdrawn(yard):
    yard.here.outcomes = [MOVES]
    address = await yard.want(2)
    await yard.withdraw(address)
    report = await yard.report()
    assert (report.stage, report.running, yard.text) == (BundleStage.WITHDRAWN, yard.first, "version 1")
    await yard.want(2, rollout="r2")
    assert (await yard.report()).stage is BundleStage.DONE, "the same bundle may be rolled out again"


async def test_a_waiting_bundle_is_rolled_back_before_another_one_is_considered(yard):
    yard.here.outcomes = [MOVES]
    await yard.want(3)
    await yard.want(2, rollout="r2")
    assert ((await yard.report()).stage, yard.text) == (BundleStage.WITHDRAWN, "version 1")
    await yard.agent.poll()
    report = await yard.report()
    assert (report.rollout, report.stage, report.running) == ("r2", BundleStage.REFUSED, yard.first)
    assert yard.here.applied[-1] == b"version 1 "


async def test_a_bundle_that_is_done_is_not_withdrawn(yard):
    await yard.withdraw(await yard.want(2))
    assert ((await yard.report()).stage, yard.text) == (BundleStage.DONE, "version 2")


async def test_a_silent_store_interrupts_no_bundle_in_progress(yard):
    yard.here.outcomes = [MOVES]
    await yard.want(2)
    yard.store.silent = True
    await yard.agent.poll()
    assert yard.agent.problem == "the store of roll-outs does not answer"
    assert yard.agent.record.stage is BundleStage.DONE
    yard.store.silent = False
    await yard.agent.poll()
    assert (yard.agent.problem, (await yard.report()).stage) == ("", BundleStage.DONE)


@pytest.mark.parametrize("before", ["the link", "the edge was asked"])
async def test_an_agent_that_is_killed_half_way_continues_from_its_disk(yard, before, monkeypatch):
    def die(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(
        *((yard.installation, "activate") if before == "the link" else (yard.here, "apply")), die
    )
    with pytest.raises(KeyboardInterrupt):
        await yard.want(2)
    assert yard.text == ("version 1" if before == "the link" else "version 2")
    monkeypatch.undo()
    yard.start()
    await yard.agent.poll()
    assert ((await yard.report()).stage, yard.text) == (BundleStage.DONE, "version 2")


async def test_changed_code_is_reloaded_and_a_file_that_only_a_start_reads_waits_for_one(yard):
    yard.here.code = Code(("puppet",), ("bodies/rex.yaml",))
    yard.clock.advance(10.0)
    await yard.want(2)
    report = await yard.report()
    assert (report.stage, yard.here.reloaded) == (BundleStage.WAITING, ["puppet"])
    assert report.why == "restart the edge: only its start reads bodies/rex.yaml"
    await yard.agent.poll()
    assert yard.here.reloaded == ["puppet"], "once"
    yard.here.state = Running("ok", "", yard.clock.time() + 1.0)
    await yard.agent.poll()
    assert (await yard.report()).stage is BundleStage.DONE


async def test_an_unexpected_error_does_not_end_the_agent(yard, caplog):
    looks = 0

    def breaks(folder, before):
        raise RuntimeError("nobody foresaw this")

    async def two_looks(_seconds):
        nonlocal looks
        looks += 1
        yard.here.check = check
        if looks == 2:
            raise asyncio.CancelledError

    check, yard.here.check = yard.here.check, breaks
    address, data, desired = desired_of(KEY, 2)
    yard.store.bundles[address] = data
    await yard.store.put_desired("yard-1", desired)
    yard.agent._sleep = two_looks
    with pytest.raises(asyncio.CancelledError):
        await yard.agent.run(5.0)
    assert "nobody foresaw this" in caplog.text
    assert ((await yard.report()).stage, yard.text) == (BundleStage.DONE, "version 2")


async def other_signature(yard):
    await yard.want(2, key=new_key())
    return "no trusted key signed the bundle"


async def rolled_back_version(yard):
    await yard.want(5)
    await yard.want(4, rollout="r2")
    return "version 4 is not newer than version 5"


async def other_bundle_of_the_same_version(yard):
    await yard.want(5)
    await yard.want(5, rollout="r2", text="other")
    return "version 5 is not newer than version 5"


async def replayed_bundle(yard):
    """Offer an old bundle with a valid signature after a newer one; return the expected refusal."""
    await yard.want(2)
    await yard.want(3, rollout="r2")
    await yard.want(2, rollout="r3")
    return "version 2 is not newer than version 3"


async def content_of_another_address(yard):
    address, _, _ = desired_of(KEY, 3)
    await yard.want(2, at=address)
    return "changed on its way"


async def bundle_of_another_edge(yard):
    await yard.want(2, edges=("yard-2",))
    return "the bundle is for yard-2, not for edge yard-1"


async def too_large(yard):
    await yard.want(2, data=HEAD + b"x" * LARGEST)
    return "more than 16 MiB"


async def no_bundle_at_all(yard):
    await yard.want(2, data=b"<html>")
    return "it is no bundle"


ATTEMPTS = [
    other_signature,
    rolled_back_version,
    other_bundle_of_the_same_version,
    replayed_bundle,
    content_of_another_address,
    bundle_of_another_edge,
    too_large,
    no_bundle_at_all,
]


@pytest.mark.parametrize("attempt", ATTEMPTS, ids=lambda attempt: attempt.__name__)
async def test_an_attempt_is_refused_recorded_and_changes_nothing(yard, attempt):
    words = await attempt(yard)
    report = await yard.report()
    assert report.stage is BundleStage.REFUSED
    assert words in report.why
    assert yard.installation.record().refusals[-1].why == report.why
    assert yard.installation.current == yard.installation.record().running
    applied = len(yard.here.applied)
    await yard.agent.poll()
    assert len(yard.here.applied) == applied, "it is not tried again"


class Killed(BaseException):
    """Kill of the agent at some point."""


def dying(call, left):
    """Return a call that kills the agent after ``left[0]`` calls, before or after its effect."""

    def dies(*arguments):
        left[0] -= 1
        if left[0] == 0:
            raise Killed
        result = call(*arguments)
        left[0] -= 1
        if left[0] == 0:
            raise Killed
        return result

    return dies


OUTCOMES = (ApplyResult(), MOVES, ApplyResult(failed="rex: it does not answer"), Refused("edge yard-1: no"))
steps = st.lists(
    st.one_of(
        st.tuples(st.just("want"), st.integers(1, 6), st.lists(st.sampled_from(OUTCOMES), max_size=3)),
        st.tuples(st.just("withdraw"), st.none(), st.none()),
        st.tuples(st.just("turn"), st.none(), st.none()),
        st.tuples(st.just("kill"), st.integers(1, 8), st.none()),
        st.tuples(st.just("silent"), st.booleans(), st.none()),
    ),
    max_size=12,
)


async def live(yard, story):
    """Run an agent through a sequence of events, then undisturbed until it settles."""
    last, number = yard.first, 0
    for what, value, outcomes in story:
        left = [value if what == "kill" else -1]
        keep, activate = yard.installation.save_record, yard.installation.activate
        yard.installation.save_record, yard.installation.activate = dying(keep, left), dying(activate, left)
        try:
            if what == "want":
                number, yard.here.outcomes = number + 1, list(outcomes)
                silent, yard.store.silent = yard.store.silent, False
                address, data, desired = desired_of(KEY, value, rollout=f"r{number}")
                last, yard.store.bundles[address] = address, data
                await yard.store.put_desired("yard-1", desired)
                yard.store.silent = silent
            elif what == "withdraw" and not yard.store.silent:
                await yard.store.put_desired("yard-1", DesiredState(f"r{number}", last, 1, withdrawn=True))
            elif what == "silent":
                yard.store.silent = value
            await yard.agent.poll()
        except Killed:
            yard.start()
        finally:
            yard.installation.save_record, yard.installation.activate = keep, activate
    yard.store.silent, yard.here.outcomes = False, []
    yard.start()
    for _ in range(4):
        await yard.agent.poll()


@settings(max_examples=60)
@given(story=steps)
def test_any_sequence_of_events_ends_with_one_complete_bundle(story):
    with tempfile.TemporaryDirectory() as folder:
        yard = Yard(Path(folder))
        asyncio.run(live(yard, story))
        record = yard.agent.record
        assert record.stage in SETTLED
        assert yard.installation.current == record.running
        applied = yard.here.applied
        assert not applied or applied[-1] == yard.installation.file_in_use.read_bytes()
        versions = [int(content.split()[1]) for content in applied]
        assert record.highest == max([1, *versions])
