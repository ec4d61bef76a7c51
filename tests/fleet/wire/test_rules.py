"""The one table: every topic of the contract, and what holds for all rows."""

import itertools
from typing import get_args

import pytest

from fleet.model.report import Report
from fleet.wire.rules import (
    CHANNEL_SUFFIXES,
    ENVIRONMENT,
    INWARD,
    LARGEST,
    REPLY_INBOX,
    RULES,
    Kind,
    Recipient,
    TopicForm,
    TrafficClass,
    rule_of,
)
from fleet.wire.topics import Topics, data_key, parse_data_key

TWIN = "6f0c9a1e-3b7d-4c55-9a41-0d6f6f1f2a10"

# What the contract lists (reference 3), as it is written there.
CONTRACT_OUT = [
    "position",
    "rotation",
    "scale",
    "joint:update",
    "joint_states",
    "navigate/status",
    "start_video/status",
    "stop_video/status",
    "command",
    "gps",
    "imu",
    "battery/status",
    "flight_state",
    "flight_controller",
    "metrics",
    "depth",
    "pointcloud",
    "map_update",
    "camera/photo",
    "mission/status",
    "telemetry",
    "edge_health",
    "driverlog",
    "event",
    "webrtc-offer",
    "webrtc-answer",
    "webrtc-candidate",
    "model_output",
    "model_health",
    "ping:request",
    "pong:response",
    "workflow:execution/started",
    "workflow:execution/+/finished",
]
CONTRACT_IN = [
    "command",
    "navigate/command",
    "motion/command",
    "mission/command",
    "joint:update",
    "alert",
    "webrtc-offer",
    "webrtc-answer",
    "webrtc-candidate",
    "commands/sync_workflows",
    "ping:request",
    "pong:response",
    "workflow:run",
    "workflow:cancel",
    "workflow-run:status",
    "edge_health",
    "position",
    "rotation",
    "scale",
]


def test_every_topic_of_the_contract_has_a_row_and_there_is_no_other():
    assert set(RULES) == {*CONTRACT_OUT, REPLY_INBOX, ENVIRONMENT}
    assert set(INWARD) == {*CONTRACT_IN, ENVIRONMENT}


def test_every_report_has_a_topic_with_a_rule():
    made = {rule.channel for rule in RULES.values() if rule.form is TopicForm.REPORT}
    assert {kind.channel for kind in get_args(Report)} == made | {"event"}
    assert RULES["event"].form is TopicForm.DOCUMENT  # other programs put events of their own there


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.suffix)
def test_what_must_arrive_is_sent_at_qos_1_and_state_at_qos_0(rule):
    assert rule.qos == (2 if rule.suffix == "webrtc-offer" else 1 if rule.traffic.durable else 0)
    assert rule_of(rule.suffix) is rule
    assert 0 < rule.size <= LARGEST


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.suffix)
def test_what_the_edge_says_itself_is_made_from_no_channel(rule):
    assert (rule.form is TopicForm.SAID) == (rule.channel == "")


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.suffix)
def test_a_repeat_is_never_faster_than_the_limit(rule):
    assert rule.repeat <= rule.max_rate or rule.max_rate == 0


@pytest.mark.parametrize("suffix", ["position", "rotation", "joint:update", "scale"])
def test_a_parked_robot_is_reported_once_a_second_so_that_it_does_not_look_gone(suffix):
    assert rule_of(suffix).repeat >= 1


def test_pose_stays_below_the_40_hz_and_gps_at_the_2_hz_of_the_platform():
    assert 0 < rule_of("position").max_rate <= 40
    assert 0 < rule_of("joint:update").max_rate <= 40
    assert rule_of("gps").max_rate == 2


def test_nothing_unchanged_is_repeated_where_the_message_is_an_event():
    assert all(rule.repeat == 0 for rule in RULES.values() if rule.traffic.durable)


def test_any_requesters_inbox_carries_replies():
    rule = rule_of("command/python-sdk_live_1f/response")
    assert (rule.traffic, rule.qos) == (TrafficClass.REPLY, 1)


def test_any_update_of_an_environment_has_the_rule_of_environments():
    assert rule_of("environment:twin_added") is RULES[ENVIRONMENT]


def test_the_end_of_any_execution_of_a_workflow_has_its_rule():
    rule = rule_of("workflow:execution/6f0c9a1e/finished")
    assert (rule.traffic, rule.qos) == (TrafficClass.STATUS, 1)


def test_replies_go_before_status_before_events_before_state_before_streams():
    assert (
        TrafficClass.REPLY
        < TrafficClass.STATUS
        < TrafficClass.EVENT
        < TrafficClass.LATEST
        < TrafficClass.STREAM
    )
    assert rule_of("navigate/status").traffic is TrafficClass.STATUS
    assert rule_of("telemetry").traffic is TrafficClass.EVENT
    assert {rule_of(suffix).traffic for suffix in ("imu", "depth", "pointcloud")} == {TrafficClass.STREAM}


def test_a_channel_that_feeds_two_topics_has_one_rule():
    assert CHANNEL_SUFFIXES["position"] == ("position", "rotation")
    position, rotation = rule_of("position"), rule_of("rotation")
    assert (position.traffic, position.max_rate) == (rotation.traffic, rotation.max_rate)


def test_what_this_project_does_not_send_has_no_rule():
    assert rule_of("video") is None


def test_nothing_that_comes_from_the_cloud_can_go_back_to_it():
    put = {rule.channel for rule in INWARD.values() if rule.taker is Recipient.RELAY}
    assert "" not in put
    for channel in put:
        assert parse_data_key(data_key(TWIN, channel)).channel not in CHANNEL_SUFFIXES


def test_whatever_is_asked_of_a_robot_has_no_rate_so_that_no_stop_is_lost():
    requests = [rule for rule in INWARD.values() if rule.taker.is_request]
    assert {rule.taker.value for rule in requests} == set(get_args(Kind))
    assert all(rule.max_rate == 0 for rule in requests)


def test_no_two_filters_of_a_twin_overlap():
    filters = [Topics("").filter(suffix, TWIN) for suffix in INWARD if suffix != ENVIRONMENT]
    assert len(set(filters)) == len(filters)
    assert not any({"+", "#"} & set(one) for one in filters)
    assert all(one != other for one, other in itertools.combinations(filters, 2))
