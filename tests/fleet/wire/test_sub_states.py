"""Which messages of one channel are states of their own, and how each is carried."""

import msgspec
import pytest

from fleet.model.report import BatteryReport, MetricsReport, TelemetryReport
from fleet.wire.rules import RULES, TrafficClass
from fleet.wire.sub_states import PARTED, TELEMETRY, is_telemetry_end, part_of, rule_of_part

ROW = RULES["telemetry"]
STATES = [name for name, part in TELEMETRY.items() if part.traffic is TrafficClass.LATEST]


@pytest.mark.parametrize("kind", STATES)
def test_periodic_state_is_latest_value_and_never_spooled(kind):
    rule = rule_of_part(ROW, part_of(TelemetryReport(1.0, kind)))
    assert (rule.traffic, rule.qos) == (TrafficClass.LATEST, 0)
    assert 0 < rule.max_rate <= 5


@pytest.mark.parametrize("kind", ["connected", "authority_lost", "camera_stored", "gap", "telemetry_start"])
def test_what_happened_once_is_carried_as_the_row_says(kind):
    assert part_of(TelemetryReport(1.0, kind)) == ""
    assert rule_of_part(ROW, "") is ROW


def test_a_sync_frame_is_an_event_at_qos_2():
    rule = rule_of_part(ROW, part_of(TelemetryReport(1.0, "camera_sync_frame")))
    assert (rule.traffic, rule.qos) == (TrafficClass.EVENT, 2)


def test_each_motor_is_a_state_of_its_own_however_long_its_name_is():
    parts = [part_of(TelemetryReport(1.0, "motor_status", {"motor_id": name})) for name in (1, 2, "x" * 999)]
    assert len(set(parts)) == 3
    assert max(map(len, parts)) < 100


def test_categories_that_different_programs_know_are_states_of_their_own():
    ours = MetricsReport(1.0, power={"voltage": 12.0})
    theirs = MetricsReport(1.0, errors=None, more={"load": {"loaded": True}})
    assert part_of(ours) != part_of(theirs)
    rule = rule_of_part(RULES["metrics"], part_of(MetricsReport(1.0, more={"vehicle_state": 1}, errors=None)))
    assert rule is RULES["metrics"], "the name of a category is no type of telemetry"


def test_fleet_yaml_can_make_a_part_slower_and_less_sure_but_not_surer():
    slow = msgspec.structs.replace(ROW, traffic=TrafficClass.STREAM, qos=0, max_rate=0.1, max_age=5.0)
    for kind in TELEMETRY:
        rule = rule_of_part(slow, kind)
        assert (rule.traffic, rule.qos, rule.max_rate, rule.max_age) == (TrafficClass.STREAM, 0, 0.1, 5.0)


def test_only_channels_with_several_states_are_looked_into():
    assert {"telemetry", "metrics"} == PARTED
    assert part_of(BatteryReport(1.0)) == ""


def test_an_end_that_names_a_stream_ends_that_one_alone():
    assert is_telemetry_end(TelemetryReport(1.0, "telemetry_end"))
    for field in ("sensor", "stream_source", "stream_instance_id"):
        assert not is_telemetry_end(TelemetryReport(1.0, "telemetry_end", {field: "front"}))
    assert not is_telemetry_end(TelemetryReport(1.0, "telemetry_start"))
