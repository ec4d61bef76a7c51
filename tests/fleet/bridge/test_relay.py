"""Documents from the cloud for programs on the bus: which are passed, how many, and under which key."""

import json
import logging
from types import MappingProxyType

import pytest

from fleet.bridge import relay
from fleet.bridge.relay import Relay
from fleet.cloud.values import CloudMessage
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.rules import INWARD, InboundRule, Recipient
from fleet.wire.samples import json_payload, stamp_of_header
from fleet.wire.topics import Topics

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
ALERT = MappingProxyType({"name": "smoke"})


class Bench:
    """A relay, and what it puts on the bus."""

    def __init__(self, clock):
        self.put = []
        self.refusals = RateLimitedCounter(logging.getLogger("fleet.bridge"), clock)
        self.relay = Relay(lambda key, sample: self.put.append((key, sample)), self.refusals, clock)

    def forward(self, suffix, message, *, twin=TWIN, rule=None):
        """Let a document arrive; return how many were passed by it."""
        topic = Topics("").twin(twin, suffix)
        payload = message if isinstance(message, bytes) else json.dumps(dict(message)).encode()
        known = rule or INWARD["environment:+" if suffix.startswith("environment:") else suffix]
        before = len(self.put)
        self.relay.forward(Topics("").parse(topic), known, CloudMessage(topic, payload))
        return len(self.put) - before

    @property
    def samples(self):
        return [(key, json.loads(json_payload(sample))) for key, sample in self.put]


@pytest.fixture
def bench(clock):
    return Bench(clock)


def limited(rate):
    return InboundRule("alert", Recipient.RELAY, 1, "", "alert", rate)


def test_a_document_is_put_on_the_bus_under_the_channel_of_its_rule(bench):
    bench.forward("alert", {**ALERT, "timestamp": 5.0})
    assert bench.samples == [(f"cw/{TWIN}/data/alert", {**ALERT, "timestamp": 5.0})]
    assert stamp_of_header(bench.put[0][1]) == 5.0
    assert bench.relay.passed == 1


def test_a_document_without_a_stamp_is_of_now(bench, clock):
    bench.forward("alert", ALERT)
    assert stamp_of_header(bench.put[0][1]) == clock.time()


def test_an_update_of_an_environment_is_put_under_its_type(bench):
    bench.forward("environment:Fire.Door-2", {"open": True})
    assert bench.samples == [(f"cw/{TWIN}/data/cloud/fire_door_2", {"type": "Fire.Door-2", "open": True})]


@pytest.mark.parametrize(
    ("suffix", "message"),
    [
        ("webrtc-offer", {"type": "offer", "target": "backend", "sdp": "x"}),
        ("position", {"source_type": "edge", "position": {"x": 1}}),
        ("rotation", {"source_type": "sim", "rotation": {"w": 1}}),
    ],
)
def test_what_an_edge_has_sent_itself_is_left_out_without_a_word(bench, suffix, message):
    assert bench.forward(suffix, message) == 0
    assert (bench.refusals.total, bench.relay.passed) == (0, 0)


def test_what_the_editor_has_set_is_passed(bench):
    assert bench.forward("position", {"source_type": "edit", "position": {"x": 1.5}}) == 1


@pytest.mark.parametrize(
    "message", [b"[]", b"{", b'{"name": NaN}', b"{}", b'{"name": "' + b"x" * 65536 + b'"}']
)
def test_what_cannot_be_read_is_refused_and_counted(bench, caplog, message):
    assert bench.forward("alert", message) == 0
    assert bench.refusals.counts() == {"unreadable": 1}
    assert f"a message on cyberwave/twin/{TWIN}/alert was not forwarded: " in caplog.text
    assert bench.relay.passed == 0


def test_a_channel_that_cannot_be_a_key_is_refused(bench, caplog):
    rule = InboundRule("alert", Recipient.RELAY, 1, "", "no channel")
    assert bench.forward("alert", ALERT, rule=rule) == 0
    assert "'no channel' is not a channel" in caplog.text


def test_the_messages_of_one_second_may_come_at_once_and_no_more(bench, caplog):
    taken = [bench.forward("alert", ALERT, rule=limited(3)) for _ in range(5)]
    assert taken == [1, 1, 1, 0, 0]
    assert bench.refusals.counts() == {"too often": 2}
    assert f"cyberwave/twin/{TWIN}/alert arrives more than 3 times a second" in caplog.text


def test_messages_pass_again_at_the_rate_and_an_idle_time_saves_no_more_than_a_second(bench, clock):
    rule = limited(2)
    for _ in range(2):
        bench.forward("alert", ALERT, rule=rule)
    clock.advance(0.49)
    assert bench.forward("alert", ALERT, rule=rule) == 0
    clock.advance(0.02)
    assert [bench.forward("alert", ALERT, rule=rule) for _ in range(2)] == [1, 0]
    clock.advance(3600)
    assert [bench.forward("alert", ALERT, rule=rule) for _ in range(3)] == [1, 1, 0]


def test_a_rate_below_one_a_second_lets_the_first_message_pass(bench, clock):
    rule = limited(0.1)
    assert [bench.forward("alert", ALERT, rule=rule) for _ in range(2)] == [1, 0]
    clock.advance(9.9)
    assert bench.forward("alert", ALERT, rule=rule) == 0
    clock.advance(0.2)
    assert bench.forward("alert", ALERT, rule=rule) == 1


def test_without_a_rate_all_messages_pass(bench):
    assert sum(bench.forward("alert", ALERT, rule=limited(0)) for _ in range(500)) == 500


def test_each_twin_and_each_topic_has_a_rate_of_its_own(bench):
    rule = limited(1)
    for _ in range(2):
        bench.forward("alert", ALERT, rule=rule)
    places = [("alert", OTHER), ("workflow-run:status", TWIN), ("alert", TWIN), ("alert", OTHER)]
    message = {**ALERT, "status": "x"}
    assert [bench.forward(suffix, message, twin=twin, rule=rule) for suffix, twin in places] == [1, 1, 0, 0]


def test_a_refused_message_uses_up_the_rate_because_it_costs_as_much(bench):
    rule = limited(1)
    assert bench.forward("alert", b"[]", rule=rule) == 0
    assert bench.forward("alert", ALERT, rule=rule) == 0
    assert bench.refusals.counts() == {"unreadable": 1, "too often": 1}


def test_rates_of_very_many_topics_are_forgotten_together(bench, monkeypatch):
    monkeypatch.setattr(relay, "MOST_ALLOWANCES", 2)
    rule = limited(1)
    twins = [TWIN[:-2] + f"{number:02d}" for number in range(4)]
    for twin in twins[:3]:
        assert bench.forward("alert", ALERT, twin=twin, rule=rule) == 1
    assert bench.forward("alert", ALERT, twin=twins[3], rule=rule) == 1
    assert list(bench.relay._allowances) == [(twins[3], "alert")]
    assert bench.forward("alert", ALERT, twin=twins[0], rule=rule) == 1
