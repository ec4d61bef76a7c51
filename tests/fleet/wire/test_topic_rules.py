import pytest
from pydantic import ValidationError

from fleet.wire.rulebook import RuleChange
from fleet.wire.rules import INWARD, RULES, Recipient, TopicForm, TrafficClass
from fleet.wire.topic_rules import INWARD_NAMES, OUTWARD_NAMES, ChannelConfig, TopicsConfig


def test_every_topic_that_is_not_the_edges_own_can_be_changed_by_name():
    assert set(OUTWARD_NAMES.values()) == {
        rule.suffix for rule in RULES.values() if rule.form is not TopicForm.SAID
    }
    assert {rule.suffix for rule in INWARD.values() if rule.taker is not Recipient.EDGE} <= set(
        INWARD_NAMES.values()
    )
    assert OUTWARD_NAMES["joint/update"] == "joint:update"
    assert OUTWARD_NAMES["environment"] == "environment:+"


def test_what_is_written_becomes_the_bridges_changes():
    topics = TopicsConfig(
        rules={"joint/update": {"rate": 5, "traffic": "stream"}, "imu": {"on": False}},
        inbound={"alert": {"size": 100}},
    )
    changes = topics.changes()
    assert changes.outward == {
        "joint:update": RuleChange(rate=5, traffic=TrafficClass.STREAM),
        "imu": RuleChange(on=False),
    }
    assert changes.inward == {"alert": RuleChange(size=100)}


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"rules": {"positon": {}}}, "one of"),
        ({"rules": {"edge_health": {}}}, "one of"),
        ({"inbound": {"edge_health": {"on": False}}}, "one of"),
        ({"rules": {"position": {"rate": 0}}}, "greater than"),
        ({"rules": {"position": {"size": 33 * 1024 * 1024}}}, "less than"),
        ({"rules": {"position": {"traffic": "reply"}}}, "Input should be"),
        ({"rules": {"rotation": {"rate": 5}}}, "is made with position"),
        ({"inbound": {"command": {"on": False}}}, "stops come on command"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(fields, words):
    with pytest.raises(ValidationError, match=words):
        TopicsConfig(**fields)


@pytest.mark.parametrize(
    "topic", ["command", "command/x", "position", "alert", "navigate/status", "a/+", "#", "A", "a//b", ""]
)
def test_an_added_channel_cannot_pose_as_something_the_cloud_knows(topic):
    with pytest.raises(ValidationError):
        ChannelConfig(topic=topic)
