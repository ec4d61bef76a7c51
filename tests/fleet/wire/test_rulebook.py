import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.wire.rulebook import (
    PROFILES,
    ExtraChannel,
    RuleChange,
    RuleChanges,
    of_a_workflow,
    of_an_environment,
    rulebook,
    run_rules,
    twin_rules,
)
from fleet.wire.rules import CHANNEL_SUFFIXES, ENVIRONMENT, INWARD, RULES, TopicForm, TrafficClass

CHANGES = st.builds(
    RuleChange,
    st.none() | st.booleans(),
    st.none() | st.floats(0.01, 100),
    st.none()
    | st.sampled_from([TrafficClass.STATUS, TrafficClass.EVENT, TrafficClass.LATEST, TrafficClass.STREAM]),
    st.none() | st.floats(0.1, 100),
    st.none() | st.integers(1, 10**6),
)


def test_on_a_lan_the_table_is_as_it_stands():
    book = rulebook()
    assert book.off == {"joint_states"}
    assert book.outward == {channel: RULES[suffixes[0]] for channel, suffixes in CHANNEL_SUFFIXES.items()}
    assert book.inward == {suffix: rule for suffix, rule in INWARD.items() if rule.on}


@pytest.mark.parametrize("profile", PROFILES)
def test_a_profile_changes_only_topics_that_there_are_and_drops_nothing_that_must_arrive(profile):
    chosen = PROFILES[profile]
    assert chosen.changes.keys() <= RULES.keys()
    book = rulebook(profile)
    for suffix in ("navigate/status", "telemetry", "driverlog", "position", "event", "webrtc-offer"):
        assert suffix not in book.off
    assert book.outward["position"].repeat >= 1
    assert book.outward["position"].max_rate >= 1


def test_a_slower_way_never_carries_more():
    order = [rulebook(name) for name in ("lan", "lte", "satellite")]
    for wide, narrow in itertools.pairwise(order):
        assert narrow.backlog < wide.backlog
        for channel, rule in narrow.outward.items():
            assert rule.size <= wide.outward[channel].size
            assert rule.max_rate <= (wide.outward[channel].max_rate or float("inf"))


def test_what_a_robot_says_wins_over_the_fleet_and_that_over_the_profile():
    fleet = RuleChanges({"position": RuleChange(rate=7), "imu": RuleChange(on=True)})
    robot = RuleChanges({"position": RuleChange(rate=9)})
    assert rulebook("satellite", [fleet]).outward["position"].max_rate == 7
    book = rulebook("satellite", [fleet, robot])
    assert book.outward["position"].max_rate == 9
    assert book.outward["imu"].max_rate == RULES["imu"].max_rate


@given(st.dictionaries(st.sampled_from(sorted(RULES)), CHANGES, max_size=6))
def test_whatever_is_changed_the_rules_hold_together(changes):
    book = rulebook("lan", [RuleChanges(changes)])
    for rule in book.outward.values():
        assert rule.repeat == 0 or rule.repeat <= rule.max_rate or rule.max_rate == 0
        if rule.traffic.durable:
            assert (rule.repeat, rule.qos > 0) == (0, True)
        elif rule.traffic is not RULES[rule.suffix].traffic:
            assert rule.qos == 0


def test_a_rate_never_thins_what_is_asked_of_a_robot():
    inward = {suffix: RuleChange(rate=0.001, size=10) for suffix in INWARD}
    book = rulebook("lan", [RuleChanges(inward=inward)])
    for rule in book.inward.values():
        assert rule.size == 10
        assert rule.max_rate == (0 if rule.taker.is_request else 0.001)


def test_a_topic_from_the_cloud_can_be_left_alone():
    book = rulebook("lan", [RuleChanges(inward={"alert": RuleChange(on=False)})])
    assert "alert" not in book.inward
    assert "alert" in rulebook().inward


def test_an_added_channel_is_a_document_of_its_own():
    book = rulebook(
        "lan", (), {"thermal": ExtraChannel("sensors/thermal", TrafficClass.EVENT, 2.0, 5.0, 100)}
    )
    rule = book.outward["thermal"]
    assert (rule.suffix, rule.qos, rule.max_rate, rule.max_age, rule.size) == (
        "sensors/thermal",
        1,
        2.0,
        5.0,
        100,
    )
    assert rule.form is TopicForm.DOCUMENT


def test_twins_environments_and_runs_have_each_their_own_part():
    book = rulebook("lan", [RuleChanges(inward={"workflow-run:status": RuleChange(on=True)})])
    twin, place, run = twin_rules(book), of_an_environment(book), run_rules(book)
    assert set(place.outward) == {"environment"}
    assert (set(place.inward), set(run.inward)) == ({ENVIRONMENT}, {"workflow-run:status"})
    workflow = of_a_workflow(book)
    assert set(workflow.inward) == {"workflow:run", "workflow:cancel"}
    others = set(place.inward) | set(run.inward) | set(workflow.inward)
    assert set(twin.inward) | others == set(book.inward)
    assert not set(twin.inward) & others
