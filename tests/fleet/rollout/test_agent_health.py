"""Rollback of an edge that gets less healthy with a bundle, or ends with it."""

import msgspec
import pytest

from fleet.rollout.agent import GONE_FOR
from fleet.rollout.edge_here import ApplyResult, Running
from fleet.rollout.faults import PartFault
from fleet.rollout.messages import BundleStage
from tests.tools.rollout_yard import Yard

BATTERY = PartFault("max", "degraded", "battery 9 %")
MOTOR = PartFault("rex", "fault", "motor 3")
WAITS = ApplyResult(waits="edge yard-1 does not run; it starts with this bundle")


@pytest.fixture
def yard(tmp_path):
    return Yard(tmp_path)


def changes_later(yard, seconds, state):
    """Change the state of the edge some seconds from now, if it runs with version 2."""
    at, before = yard.clock.monotonic() + seconds, yard.here.state

    def running():
        later = yard.text == "version 2" and yard.clock.monotonic() >= at
        return state if later else before

    yard.here.running = running


async def test_an_edge_that_gets_worse_late_in_its_observation_time_rolls_back(yard):
    changes_later(yard, 8.0, Running("degraded", "", 0.0, (MOTOR,)))
    await yard.want(2, settle=10.0)
    report = await yard.report()
    assert (report.stage, yard.text) == (BundleStage.FAILED, "version 1")
    assert report.why == "rex is fault, was ok: motor 3"


async def test_an_edge_that_has_recovered_at_the_end_of_its_observation_time_is_done(yard):
    yard.here.state = Running("degraded", "", 0.0, (MOTOR,))
    changes_later(yard, 3.0, Running("ok", "", 0.0))
    await yard.want(2, settle=10.0)
    assert (await yard.report()).stage is BundleStage.DONE
    assert yard.clock.monotonic() >= 10.0


async def test_a_fault_that_replaces_another_fails_the_bundle_and_an_old_fault_does_not(yard):
    yard.here.state = Running("degraded", "", 0.0, (BATTERY,))
    changes_later(yard, 3.0, Running("degraded", "", 0.0, (MOTOR,)))
    await yard.want(2, settle=10.0)
    report = await yard.report()
    assert (report.stage, report.why) == (BundleStage.FAILED, "rex is fault, was ok: motor 3")


async def test_a_fault_from_before_does_not_fail_the_bundle(yard):
    yard.here.state = Running("degraded", "", 0.0, (BATTERY, MOTOR))
    changes_later(yard, 3.0, Running("degraded", "", 0.0, (MOTOR,)))
    await yard.want(2, settle=10.0)
    assert (await yard.report()).stage is BundleStage.DONE
    assert yard.installation.record().faults is None, "it is kept only until it is judged"


async def test_a_report_names_three_parts_and_the_number_of_others(yard):
    faults = tuple(PartFault(f"r{number}", "offline", "silent") for number in range(5))
    changes_later(yard, 3.0, Running("degraded", "", 0.0, faults))
    await yard.want(2, settle=10.0)
    why = (await yard.report()).why
    assert why.endswith("r2 is offline, was ok: silent; and 2 more")


async def test_a_restarted_agent_compares_with_the_faults_before_the_bundle(yard):
    yard.here.state = Running("degraded", "", 0.0, (BATTERY,))
    yard.here.outcomes = [ApplyResult(waits="rex: it is armed")]
    await yard.want(2)
    yard.start()
    yard.here.state = Running("degraded", "", 0.0, (MOTOR,))
    await yard.agent.poll()
    assert (await yard.report()).why == "rex is fault, was ok: motor 3"


async def test_with_the_record_of_an_older_version_the_health_of_the_whole_edge_is_compared(yard):
    yard.here.outcomes = [ApplyResult(waits="rex: it is armed")]
    await yard.want(2)
    yard.installation.save_record(msgspec.structs.replace(yard.installation.record(), faults=None))
    yard.start()
    yard.here.state = Running("fault", "rex: motor 3", 0.0, (MOTOR,))
    await yard.agent.poll()
    assert (await yard.report()).why == "the edge is fault, was ok: rex: motor 3"


async def test_an_edge_that_was_down_must_come_up_able_to_work(yard):
    yard.here.state, yard.here.outcomes = None, [WAITS]
    await yard.want(2)
    yard.here.state = Running("fault", "rex: motor 3", yard.clock.time() + 1.0)
    await yard.agent.poll()
    report = await yard.report()
    assert (report.stage, yard.text) == (BundleStage.FAILED, "version 1")
    assert report.why == "the edge is fault, did not run before: rex: motor 3"


async def test_an_edge_that_dies_with_the_bundle_and_stays_away_rolls_back(yard):
    def dies(by):
        yard.here.state = None
        return WAITS

    yard.here.apply = dies
    await yard.want(2)
    assert (await yard.report()).stage is BundleStage.WAITING
    yard.clock.advance(GONE_FOR - 1.0)
    await yard.agent.poll()
    assert (await yard.report()).stage is BundleStage.WAITING
    yard.clock.advance(1.0)
    await yard.agent.poll()
    report = await yard.report()
    assert (report.stage, yard.text) == (BundleStage.FAILED, "version 1")
    assert "has been gone for 60 s" in report.why


async def test_an_edge_that_did_not_run_before_is_waited_for(yard):
    yard.here.state, yard.here.outcomes = None, [WAITS] * 9
    await yard.want(2)
    yard.clock.advance(10 * GONE_FOR)
    await yard.agent.poll()
    assert (await yard.report()).stage is BundleStage.WAITING
