import pytest
from cyberwave.data.keys import build_key, parse_key
from cyberwave.mqtt.command_response import reply_inbox_topic, validated_reply_topic
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import ConfigError, WireError
from fleet.wire.topics import JOINT_UPDATE, DataKey, Topic, Topics, data_key, parse_data_key, prefix_from

TWIN = "6f0c9a1e-3b7d-4c55-9a41-0d6f6f1f2a10"
LEAVES = [
    JOINT_UPDATE,
    "position",
    "navigate/status",
    "ping:request",
    "pong:response",
    "environment:twin_added",
    "workflow-run:status",
]
WORDS = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)


@pytest.mark.parametrize(
    ("explicit", "environ", "prefix"),
    [
        (None, {}, ""),
        ("yard", {"CYBERWAVE_MQTT_TOPIC_PREFIX": "a"}, "yard"),
        ("", {"CYBERWAVE_MQTT_TOPIC_PREFIX": "a"}, ""),
        (None, {"CYBERWAVE_MQTT_TOPIC_PREFIX": "a", "CYBERWAVE_TOPIC_PREFIX": "b"}, "a"),
        (None, {"CYBERWAVE_TOPIC_PREFIX": "b", "CYBERWAVE_ENVIRONMENT": "c"}, "b"),
        (None, {"CYBERWAVE_MQTT_TOPIC_PREFIX": "", "CYBERWAVE_TOPIC_PREFIX": "b"}, "b"),
        (None, {"CYBERWAVE_ENVIRONMENT": " local "}, "local"),
        (None, {"CYBERWAVE_ENVIRONMENT": "production"}, ""),
        (None, {"CYBERWAVE_ENVIRONMENT": "Production"}, ""),
    ],
)
def test_the_prefix_comes_from_the_first_place_that_names_it(explicit, environ, prefix):
    assert prefix_from(explicit, environ) == prefix


def test_the_prefix_is_put_in_front_without_a_separator():
    assert Topics("local").twin(TWIN, "position") == f"localcyberwave/twin/{TWIN}/position"
    assert Topics("").joint(TWIN) == f"cyberwave/joint/{TWIN}/update"


@pytest.mark.parametrize("prefix", ["a+", "#", "a b", "x\0"])
def test_a_prefix_with_a_wildcard_is_refused(prefix):
    with pytest.raises(ConfigError, match="topic prefix"):
        Topics(prefix)


@pytest.mark.parametrize("twin", ["", "+", "#", f"{TWIN}/x", "6f0c9a1e", f"{TWIN} ", "../" + TWIN[3:]])
def test_what_is_no_uuid_never_becomes_a_topic(twin):
    with pytest.raises(WireError, match="not the uuid of a twin"):
        Topics("").twin(twin, "position")
    with pytest.raises(WireError, match="not the uuid of a twin"):
        data_key(twin, "position")


@pytest.mark.parametrize("suffix", ["", "+", "a/#", "/a", "a/", "a//b", "a b"])
def test_a_leaf_with_a_wildcard_or_an_empty_part_is_refused(suffix):
    with pytest.raises(WireError, match="cannot be a topic"):
        Topics("").twin(TWIN, suffix)


@given(st.sampled_from(["", "local", "dev/"]), st.sampled_from(LEAVES))
def test_a_topic_that_was_made_is_parsed_back(prefix, suffix):
    topics = Topics(prefix)
    assert topics.parse(topics.twin(TWIN, suffix)) == Topic(TWIN, suffix)


@pytest.mark.parametrize(
    "topic",
    [
        "",
        "cyberwave/twin",
        f"cyberwave/twin/{TWIN}",
        f"cyberwave/twin/{TWIN}/",
        "cyberwave/twin/{twin_uuid}/battery/status",
        f"cyberwave/joint/{TWIN}",
        f"cyberwave/pose/{TWIN}/update",
        f"cyberwave/twin/{TWIN}/joint:update",
        f"cyberwave/joint:update/{TWIN}/update",
        f"localcyberwave/twin/{TWIN}/command",
        f"cyberwave/twin/{TWIN}/+",
    ],
)
def test_a_foreign_topic_is_none(topic):
    assert Topics("").parse(topic) is None


@given(st.text())
def test_parsing_never_raises(text):
    Topics("").parse(text)
    Topics("").is_own_inbox(text, TWIN)
    parse_data_key(text)


def test_a_prefixed_edge_reads_only_its_own_prefix():
    assert Topics("local").parse(f"cyberwave/twin/{TWIN}/command") is None


def test_a_filter_names_one_twin_or_whatever_there_is():
    assert Topics("p").filter("navigate/command", TWIN) == f"pcyberwave/twin/{TWIN}/navigate/command"
    assert Topics("p").filter("environment:+", TWIN) == f"pcyberwave/environment/{TWIN}/+"
    assert Topics("").filter("workflow-run:status") == "cyberwave/workflow-run/+/status"
    with pytest.raises(WireError):
        Topics("").filter("command", "+")


@pytest.mark.parametrize("client", ["python-sdk_live_1f", "a", "client with space"])
def test_the_inbox_of_a_requester_is_recognised_like_the_sdk_does(client):
    topic = reply_inbox_topic(TWIN, client, topic_prefix="local")
    assert validated_reply_topic(topic, twin_uuid=TWIN, topic_prefix="local") == topic
    assert Topics("local").is_own_inbox(topic, TWIN)


@pytest.mark.parametrize(
    "topic",
    [
        "",
        f"cyberwave/twin/{TWIN}/command",
        f"cyberwave/twin/{TWIN}/command/response",
        f"cyberwave/twin/{TWIN}/command//response",
        f"cyberwave/twin/{TWIN}/command/a/b/response",
        f"cyberwave/twin/{TWIN}/command/+/response",
        f"cyberwave/twin/{TWIN}/command/#/response",
        f"cyberwave/twin/{TWIN}/command/a/other",
        f"cyberwave/twin/{TWIN}/navigate/a/response",
        f"localcyberwave/twin/{TWIN}/command/a/response",
        "cyberwave/twin/00000000-0000-4000-8000-000000000000/command/a/response",
    ],
)
def test_a_response_topic_that_is_not_this_twins_inbox_is_not_answered(topic):
    assert not Topics("").is_own_inbox(topic, TWIN)
    assert validated_reply_topic(topic, twin_uuid=TWIN) is None


@given(WORDS.filter(lambda word: word != "commands"), st.none() | WORDS)
def test_bus_keys_are_those_of_the_sdk(channel, sensor):
    key = data_key(TWIN, channel, sensor)
    assert key == build_key(TWIN, channel, sensor)
    assert parse_data_key(key) == DataKey(TWIN, channel, sensor)
    assert (parse_key(key).channel, parse_key(key).sensor_name) == (channel, sensor)


def test_a_command_channel_has_two_segments():
    key = data_key(TWIN, "commands/velocity")
    assert key == build_key(TWIN, "commands/velocity")
    assert parse_data_key(key) == DataKey(TWIN, "commands/velocity")


@pytest.mark.parametrize(
    ("channel", "sensor"), [("Position", None), ("a/b/c", None), ("a", "B"), ("a/b", "c")]
)
def test_names_that_the_sdk_would_not_parse_are_refused(channel, sensor):
    with pytest.raises(WireError):
        data_key(TWIN, channel, sensor)


@pytest.mark.parametrize(
    "key",
    [
        f"cw/{TWIN}/data",
        f"cw/{TWIN}/state/position",
        f"cw/{TWIN}/data/a/b/c",
        f"xx/{TWIN}/data/position",
        "cw/*/data/position",
        f"cw/{TWIN}/data/**",
        f"cw/{TWIN}/data/position/",
    ],
)
def test_a_foreign_bus_key_is_none(key):
    assert parse_data_key(key) is None
