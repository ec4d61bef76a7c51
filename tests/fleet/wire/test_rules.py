from typing import get_args

import pytest

from fleet.model.report import Report
from fleet.wire.rules import CHANNEL_LEAVES, RULES, Traffic, rule_of, rule_of_channel


def test_every_report_has_a_topic_with_a_rule():
    assert {kind.channel for kind in get_args(Report)} == set(CHANNEL_LEAVES)


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.leaf)
def test_what_must_arrive_is_sent_at_qos_1_and_state_at_qos_0(rule):
    assert rule.qos == (1 if rule.traffic.durable else 0)
    assert rule_of(rule.leaf) is rule


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.leaf)
def test_a_repeat_is_never_faster_than_the_limit(rule):
    assert rule.repeat <= rule.max_rate or rule.max_rate == 0


def test_a_parked_robot_is_told_once_a_second_so_that_it_does_not_look_gone():
    assert rule_of("position").repeat >= 1
    assert rule_of("rotation").repeat >= 1


def test_pose_stays_below_the_40_hz_and_gps_at_the_2_hz_of_the_platform():
    assert 0 < rule_of("position").max_rate <= 40
    assert 0 < rule_of("joint:update").max_rate <= 40
    assert rule_of("gps").max_rate == 2


def test_nothing_unchanged_is_repeated_where_the_message_is_an_event():
    assert all(rule.repeat == 0 for rule in RULES.values() if rule.traffic.durable)


def test_any_requesters_inbox_carries_replies():
    rule = rule_of("command/python-sdk_live_1f/response")
    assert (rule.traffic, rule.qos) == (Traffic.REPLY, 1)


def test_replies_go_before_status_before_events_before_state_before_streams():
    assert Traffic.REPLY < Traffic.STATUS < Traffic.EVENT < Traffic.LATEST < Traffic.STREAM
    assert rule_of("navigate/status").traffic is Traffic.STATUS
    assert rule_of("telemetry").traffic is Traffic.EVENT
    assert rule_of("imu").traffic is Traffic.STREAM


def test_a_channel_that_feeds_two_topics_has_one_rule():
    assert CHANNEL_LEAVES["position"] == ("position", "rotation")
    position, rotation = rule_of("position"), rule_of("rotation")
    assert (position.traffic, position.max_rate) == (rotation.traffic, rotation.max_rate)
    assert rule_of_channel("position") is position


def test_what_this_project_does_not_send_has_no_rule():
    assert rule_of("webrtc-offer") is None
    assert rule_of_channel("frames") is None
