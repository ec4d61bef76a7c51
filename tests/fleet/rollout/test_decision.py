"""Decisions of the agent of an edge."""

from hypothesis import given
from hypothesis import strategies as st

from fleet.rollout.decision import (
    ACTIONS,
    AgentAction,
    AgentRecord,
    Relation,
    action,
    relation,
    version_refusal,
)
from fleet.rollout.messages import SETTLED, BundleStage, DesiredState

AT = AgentRecord(
    running="b1", highest=2, highest_bundle="b2", rollout="r1", bundle="b2", stage=BundleStage.WAITING
)


def test_every_stage_and_relation_has_its_action():
    assert {(stage, each) for stage, row in ACTIONS.items() for each in row} == {
        (stage, each) for stage in BundleStage for each in Relation
    }


def test_the_desired_bundle_is_the_same_withdrawn_another_or_none():
    assert relation(AT, None) is Relation.NOTHING
    assert relation(AT, DesiredState("r1", "b2", 1)) is Relation.SAME
    assert relation(AT, DesiredState("r2", "b2", 1)) is Relation.OTHER
    assert relation(AT, DesiredState("r1", "b3", 1)) is Relation.OTHER
    assert relation(AT, DesiredState("r1", "b2", 1, withdrawn=True)) is Relation.WITHDRAWN
    assert relation(AT, DesiredState("r2", "b3", 1, withdrawn=True)) is Relation.NOTHING


def test_a_rollback_is_finished_before_anything_else_begins():
    assert set(ACTIONS[BundleStage.RETURNING].values()) == {AgentAction.GO_ON_BACK}


def test_a_settled_edge_acts_only_on_another_bundle_or_roll_out():
    for stage in SETTLED:
        begun = [each for each, what in ACTIONS[stage].items() if what is not AgentAction.REST]
        assert begun == [Relation.OTHER]


def test_a_waiting_bundle_continues_and_is_rolled_back_when_it_is_withdrawn():
    assert action(AT, DesiredState("r1", "b2", 1)) is AgentAction.GO_ON
    assert action(AT, DesiredState("r1", "b2", 1, withdrawn=True)) is AgentAction.RETURN
    assert action(AT, DesiredState("r2", "b3", 1)) is AgentAction.RETURN


@given(st.lists(st.tuples(st.sampled_from("abcdef"), st.integers(1, 6)), max_size=20))
def test_versions_of_activated_bundles_never_fall_except_to_the_one_in_use(wanted):
    record = AgentRecord()
    for bundle, version in wanted:
        if version_refusal(record, bundle, version):
            continue
        assert version > record.highest or bundle in (record.running, record.highest_bundle)
        highest = max(record.highest, version)
        record = AgentRecord(
            running=bundle,
            highest=highest,
            highest_bundle=bundle if version >= record.highest else record.highest_bundle,
        )
