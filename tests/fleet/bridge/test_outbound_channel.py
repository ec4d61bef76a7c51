"""One channel of a twin towards the cloud: how its rule is applied, and when its next message is due."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.bridge.outbound_channel import (
    HEAVY,
    MOST_PARTS,
    REPEAT_CHECK,
    SLACK,
    OutboundChannel,
    TwinInfo,
    is_left_out,
)
from fleet.errors import WireError
from fleet.wire.rulebook import ExtraChannel, RuleChange, RuleChanges, rulebook, twin_rules
from fleet.wire.rules import CHANNEL_SUFFIXES, INWARD, TrafficClass
from fleet.wire.topics import DataKey

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
RESULTS = ExtraChannel("results", TrafficClass.LATEST, 5.0, 0.0, HEAVY)


def channel(name, sensor=None, *, changes=None, extra=None):
    """Return the outbound channel of a bus channel, under the rules of fleet.yaml."""
    book = twin_rules(rulebook("lan", [RuleChanges(outward=changes or {})], extra or {}))
    info = TwinInfo("rex", "edge", book)
    return OutboundChannel(DataKey(TWIN, name, sensor), info, book.outward[name], "fleet_us")


def of_rate(rate):
    return channel("position", changes={"position": RuleChange(rate=rate)})


# -- what the rule means ------------------------------------------------------------------------------


def test_state_is_sent_at_once_and_repeated():
    position = channel("position")
    assert (position.at_once, position.durable, position.streams, position.shared) == (
        True,
        False,
        False,
        False,
    )
    assert (position.rate, position.repeat) == (20.0, 1.0)
    assert position.traffic == TrafficClass.LATEST


def test_a_new_channel_has_nothing_to_send_and_is_nobodys():
    one = channel("position")
    assert (one.fresh, one.ours, one.refused, one.dropped, one.sample) == (False, False, False, False, b"")
    assert one.backlog == rulebook("lan").backlog


def test_events_are_durable_shared_and_never_repeated():
    log = channel("driverlog")
    assert (log.at_once, log.durable, log.streams, log.shared) == (False, True, False, True)
    assert (log.repeat, log.traffic) == (0.0, TrafficClass.EVENT)


def test_streams_are_no_state_to_be_kept():
    imu = channel("imu", "front")
    assert (imu.streams, imu.durable, imu.at_once, imu.by.sensor_id) == (True, False, True, "front")


def test_metrics_are_shared_and_have_parts_as_telemetry_has():
    metrics, telemetry = channel("metrics"), channel("telemetry")
    assert (metrics.shared, metrics.parted, metrics.at_once) == (True, True, False)
    assert (telemetry.parted, channel("battery").parted) == (True, False)


@pytest.mark.parametrize(
    ("name", "heavy"),
    [("pointcloud", True), ("photo", True), ("event", True), ("imu", False), ("driverlog", False)],
)
def test_documents_and_large_messages_are_sent_in_steps_of_their_own(name, heavy):
    assert channel(name).heavy is heavy


@pytest.mark.parametrize(("size", "heavy"), [(HEAVY, False), (HEAVY + 1, True)])
def test_a_message_is_heavy_beyond_64_kib(size, heavy):
    one = channel("battery", changes={"battery/status": RuleChange(size=size)})
    assert (one.heavy, one.at_once, one.size) == (heavy, not heavy, size)


def test_every_message_carries_source_session_and_sensor():
    by = channel("gps", "front").by
    assert by.fields == {"source_type": "edge", "session_id": "fleet_us", "sensor_id": "front"}


def test_topics_of_a_channel_that_are_switched_off_are_known():
    both = channel("position", changes={"rotation": RuleChange(on=False)})
    assert both.off == {"rotation"}
    assert channel("battery", changes={"rotation": RuleChange(on=False)}).off == frozenset()


@pytest.mark.parametrize(
    ("suffix", "name", "sensor", "expected"),
    [
        ("", "webrtc_offer", None, "webrtc-offer"),
        ("", "environment", "fire", "environment:fire"),
        ("", "environment", None, "environment:"),
        ("results", "own", None, "results"),
        ("results", "own", "left", "results/left"),
    ],
)
def test_the_sensor_of_a_document_is_a_part_of_its_topic(suffix, name, sensor, expected):
    book = rulebook("lan", (), {"own": RESULTS})
    one = OutboundChannel(DataKey(TWIN, name, sensor), TwinInfo("rex", "edge", book), book.outward[name], "")
    assert one.suffix == expected


# -- when the next is due -----------------------------------------------------------------------------


def test_the_first_message_is_due_at_once():
    assert of_rate(5.0).due == float("-inf")


@given(st.floats(0.1, 100.0), st.floats(0.0, 1e6))
def test_messages_are_a_period_apart_less_a_little(rate, now):
    one = of_rate(rate)
    one.mark_sent(now)
    one.due = now
    one.mark_sent(now)
    assert one.due == pytest.approx(now + 1 / rate - SLACK)


def test_a_late_message_does_not_delay_those_behind_it():
    one = of_rate(10.0)
    one.due = 100.0
    one.mark_sent(100.04)
    assert one.due == pytest.approx(100.099)
    assert one.sent == 100.04


def test_after_a_silence_the_next_message_is_due_half_a_period_later():
    one = of_rate(10.0)
    one.due = 100.0
    one.mark_sent(500.0)
    assert one.due == pytest.approx(500.0495)


def test_without_a_rate_every_message_is_due():
    one = of_rate(0)
    one.mark_sent(100.0)
    assert (one.period, one.due <= 100.0) == (0.0, True)


def test_a_source_at_exactly_its_rate_loses_nothing():
    one = of_rate(20.0)
    sent = 0
    for number in range(1000):
        now = 100.0 + number / 20.0
        if now >= one.due:
            one.mark_sent(now)
            sent += 1
    assert sent == 1000


@pytest.mark.parametrize(
    ("name", "silence"),
    [("position", 1.0 - 1.5 * REPEAT_CHECK), ("battery", 10.0 - 1.5 * REPEAT_CHECK), ("gps", 0.5 - SLACK)],
)
def test_a_state_is_repeated_a_little_early_but_not_above_its_rate(name, silence):
    assert channel(name).silence == pytest.approx(silence)


def test_a_repetition_is_never_more_frequent_than_the_rate():
    assert of_rate(0.5).silence == pytest.approx(2.0 - SLACK)


# -- events above the rate ----------------------------------------------------------------------------


def test_the_events_of_one_second_may_come_at_once_and_no_more():
    one = channel("driverlog")
    assert [one.admits_event(100.0) for _ in range(12)] == [True] * 10 + [False] * 2
    assert [one.admits_event(100.125) for _ in range(2)] == [True, False]
    assert [one.admits_event(900.0) for _ in range(12)] == [True] * 10 + [False] * 2


def test_a_rate_below_one_a_second_admits_the_first_event():
    one = channel("driverlog", changes={"driverlog": RuleChange(rate=0.5)})
    assert [one.admits_event(now) for now in (100.0, 100.0, 101.9, 102.1, 102.2)] == [
        True,
        False,
        False,
        True,
        False,
    ]


# -- parts --------------------------------------------------------------------------------------------


def test_a_part_has_a_route_and_a_time_of_its_own_under_the_rule_of_its_type():
    telemetry = channel("telemetry", "left")
    part = telemetry.part("vehicle_state")
    assert part is telemetry.part("vehicle_state")
    assert part is not telemetry.part("driver_info")
    assert (part.traffic, part.rate, telemetry.traffic) == (TrafficClass.LATEST, 5.0, TrafficClass.EVENT)
    assert (part.key, part.by.sensor_id, part.session) == (telemetry.key, "left", "fleet_us")
    assert telemetry.part("") is telemetry


def test_the_parts_of_a_channel_are_bounded_and_those_there_are_go_on():
    metrics = channel("metrics")
    parts = [metrics.part(f"p{number}") for number in range(MOST_PARTS)]
    with pytest.raises(WireError, match=f"metrics: more than {MOST_PARTS} different states"):
        metrics.part("one more")
    assert metrics.part("p0") is parts[0]
    assert metrics.part("") is metrics


def test_a_dropped_channel_drops_its_parts_also_those_that_come_later():
    telemetry = channel("telemetry")
    before = telemetry.part("vehicle_state")
    assert (telemetry.dropped, before.dropped) == (False, False)
    telemetry.drop()
    assert (telemetry.dropped, before.dropped, telemetry.part("driver_info").dropped) == (True, True, True)


# -- channels without a rule --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    ["commands/stop", "commands_sync_workflows", "cloud", "frames", "local"]
    + [rule.channel for rule in INWARD.values() if rule.channel],
)
def test_a_channel_for_programs_on_the_bus_is_not_left_out(name):
    assert not is_left_out(DataKey(TWIN, name))


@pytest.mark.parametrize("name", sorted(CHANNEL_SUFFIXES))
def test_a_channel_of_the_table_is_not_left_out_though_it_may_be_switched_off(name):
    assert not is_left_out(DataKey(TWIN, name))


@pytest.mark.parametrize(
    ("name", "sensor", "left_out"),
    [("mine", None, True), ("mine", "front", True), ("battery", "front", True), ("imu", "front", False)],
)
def test_an_unknown_channel_or_a_sensor_of_a_channel_without_sensors_is_left_out(name, sensor, left_out):
    assert is_left_out(DataKey(TWIN, name, sensor)) is left_out
