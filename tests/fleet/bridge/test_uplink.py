import itertools
import json
import logging
import operator
import sys
import threading
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.bridge.outbound_channel import MOST_PARTS, SLACK, TwinInfo
from fleet.bridge.uplink import MOST_KEYS, Uplink
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    FlightStateReport,
    ImuReport,
    JointReport,
    LogReport,
    MetricsReport,
    NavigationReport,
    PhotoReport,
    PointCloudReport,
    PoseReport,
    ScaleReport,
    TelemetryReport,
)
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.testing.clock import ManualClock
from fleet.wire.databus import encode_report
from fleet.wire.rulebook import ExtraChannel, RuleChange, RuleChanges, of_an_environment, rulebook, twin_rules
from fleet.wire.rules import CHANNEL_SUFFIXES, KIB, RULES, TrafficClass
from fleet.wire.topics import Topics
from tests.tools.waiting import DEADLINE

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c99"
POSITION = f"cw/{TWIN}/data/position"
BATTERY = f"cw/{TWIN}/data/battery"
STATUS = f"cw/{TWIN}/data/navigate_status"
LOG = f"cw/{TWIN}/data/driverlog"
METRICS = f"cw/{TWIN}/data/metrics"
SCALE = f"cw/{TWIN}/data/scale"
ONES = Vector3(1.0, 1.0, 1.0)
TICK = 0.02


class Bench:
    """An uplink, and what it publishes at which time."""

    def __init__(self, book=None, environments=()) -> None:
        self.alive = True
        self.queued_bytes = 0
        self.full = False
        self.clock = ManualClock()
        twins = {TWIN: TwinInfo("rex", "edge", twin_rules(book or rulebook()))}
        twins |= {uuid: TwinInfo("", "edge", of_an_environment(rulebook())) for uuid in environments}
        self.sent: list[tuple[float, str, dict, int]] = []
        self.uplink = Uplink(
            Topics(""),
            twins,
            session="us",
            open_route=lambda topic, rule: partial(self._publish, topic, rule.qos),
            client=self,
            alive=lambda name: self.alive and name == "rex",
            waiting=lambda: self.queued_bytes,
            full=lambda: self.full,
            refusals=RateLimitedCounter(logging.getLogger("fleet.bridge"), self.clock),
            clock=self.clock,
        )

    @property
    def now(self):
        return self.clock.monotonic()

    def queue(self, route, payload):
        route(payload)

    def _publish(self, topic, qos, payload):
        self.sent.append((self.now, topic.partition(f"{TWIN}/")[2], json.loads(payload), qos))

    def forward(self, reports):
        """Have reports of our own robot cross, by key."""
        self.uplink.forward([(self.uplink.open(key), report) for key, report in reports.items()])

    def turn(self, seconds=TICK):
        self.clock.advance(seconds)
        for _ in self.uplink.tick():
            pass

    def run(self, seconds):
        for _ in range(round(seconds / TICK)):
            self.turn()

    def of(self, suffix):
        return [(when, message) for when, sent, message, _ in self.sent if sent == suffix]


def a_pose(x):
    return PoseReport(1.0, Vector3(float(x), 2.0, 3.0), Quaternion())


def a_photo(width):
    return PhotoReport(1.0, b"picture", "jpeg", width, 10)


def battery(percent):
    return encode_report(BatteryReport(1.0, percent), 0)


def status(action, progress=0.0):
    return encode_report(NavigationReport(1.0, action, ActionState.RUNNING, progress), 0)


def line(text):
    return encode_report(LogReport(1.0, "WARNING", text), 0)


def say(bench, channel, message):
    """Have a program on the bus say something of the twin."""
    bench.uplink.arrived(f"cw/{TWIN}/data/{channel}", json.dumps({"ts": 1.0, **message}).encode())


@pytest.fixture
def bench():
    return Bench()


def test_a_state_that_waited_when_its_robot_was_replaced_is_not_sent_any_more(bench, pose):
    bench.full = True
    bench.turn()
    for key, sample in ((POSITION, pose(1.0)), (SCALE, encode_report(ScaleReport(1.0, ONES), 0))):
        bench.uplink.arrived(key, sample)
    bench.forward({METRICS: MetricsReport(1.0, power={"voltage": 12.0})})  # a part of its channel
    assert bench.uplink.waiting == 3
    bench.uplink.drop(TWIN)
    bench.full = False
    bench.uplink.arrived(POSITION, pose(2.0))
    bench.run(2.0)
    assert bench.uplink.waiting == 0
    assert {message["position"]["x"] for _, message in bench.of("position")} == {2.0}
    assert {suffix for _, suffix, _, _ in bench.sent} == {"position", "rotation"}


def test_a_pose_becomes_two_topics_in_the_cloud_s_form(bench, pose):
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn()
    assert [(suffix, qos) for _, suffix, _, qos in bench.sent] == [("position", 0), ("rotation", 0)]
    message = bench.sent[0][2]
    assert message["position"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert (message["source_type"], message["session_id"]) == ("edge", "us")


def test_of_many_poses_in_a_turn_only_the_newest_crosses(bench, pose):
    for x in range(10):
        bench.uplink.arrived(POSITION, pose(x))
    bench.turn()
    assert [message["position"]["x"] for _, message in bench.of("position")] == [9.0]
    assert bench.uplink.conflated.by_class()["latest"] == 9


def test_a_state_of_our_own_robot_crosses_at_once_if_it_is_due_and_else_in_a_turn_the_newest(bench):
    for x in range(3):
        bench.forward({POSITION: a_pose(x)})
    assert [message["position"]["x"] for _, message in bench.of("position")] == [0.0]
    bench.run(0.1)
    assert [message["position"]["x"] for _, message in bench.of("position")] == [0.0, 2.0]
    assert bench.uplink.conflated.by_class()["latest"] == 1
    assert bench.uplink.received.by_class()["latest"] == 3


def test_events_of_our_own_robot_cross_at_once_and_its_pictures_in_a_turn(bench):
    bench.forward({STATUS: NavigationReport(1.0, "a", ActionState.RUNNING, 1.0)})
    bench.forward({f"cw/{TWIN}/data/depth": DepthReport(2.0, bytes(2), 1, 1, "uint16")})
    assert [suffix for _, suffix, _, _ in bench.sent] == ["navigate/status"]
    bench.turn()
    assert [suffix for _, suffix, _, _ in bench.sent] == ["navigate/status", "depth"]


@pytest.mark.parametrize("key", [f"cw/{OTHER}/data/position", f"cw/{TWIN}/data/unheard_of", "cw/x"])
def test_what_may_not_cross_is_known_before_it_is_said(bench, key):
    assert bench.uplink.open(key) is None


@pytest.mark.parametrize(
    ("channel", "report", "reason"),
    [
        ("battery", BatteryReport(1.0, 150.0), "unreadable"),
        ("imu", ImuReport(1.0, Vector3(float("nan")), Vector3()), "unreadable"),
        ("joint_states", JointReport(1.0, {f"joint_{n}" * 9: 0.1 for n in range(2000)}), "too large"),
        ("gps", "no report at all", "failed"),
    ],
)
def test_what_is_wrong_with_one_report_keeps_none_beside_it_from_crossing(bench, channel, report, reason):
    for turn in range(3):
        wrong = {f"cw/{TWIN}/data/{channel}": report}
        bench.forward(wrong | {POSITION: a_pose(turn), SCALE: ScaleReport(1.0, ONES)})
        bench.turn(0.2)
    assert [message["position"]["x"] for _, message in bench.of("position")] == [0.0, 1.0, 2.0]
    assert (len(bench.of("rotation")), len(bench.of("scale"))) == (3, 2)  # a scale goes twice a second
    assert {suffix for _, suffix, _, _ in bench.sent} == {"position", "rotation", "scale"}
    assert bench.uplink.sent.total == len(bench.sent)
    assert bench.uplink.refusals.counts()[reason] >= 2


def test_an_event_at_which_the_bridge_fails_takes_no_state_beside_it_along(bench):
    def fail(topic, _rule):
        raise ZeroDivisionError(topic)

    bench.forward({POSITION: a_pose(0.0), SCALE: ScaleReport(1.0, ONES)})
    bench.clock.advance(1.0)
    bench.sent.clear()
    bench.uplink._open_route = fail  # of a topic that has not been opened yet
    wrong = {STATUS: NavigationReport(1.0, "a", ActionState.RUNNING, 1.0)}
    bench.forward({POSITION: a_pose(1.0)} | wrong | {SCALE: ScaleReport(1.0, ONES)})
    assert sorted(suffix for _, suffix, _, _ in bench.sent) == ["position", "rotation", "scale"]
    assert bench.uplink.refusals.counts()["failed"] == 1


def test_a_state_without_a_rate_that_is_reported_twice_in_one_step_crosses_as_it_was_each_time():
    bench = Bench(rulebook("lan", [RuleChanges({"flight_state": RuleChange(rate=0.0)})]))
    route = bench.uplink.open(f"cw/{TWIN}/data/flight_state")
    for batch in (["A"], ["B", "C"]):
        bench.uplink.forward([(route, FlightStateReport(1.0, True, mode)) for mode in batch])
    assert [message["flight_mode"] for _, message in bench.of("flight_state")] == ["A", "B", "C"]


@pytest.mark.parametrize("stays", [0, 1, 2])
def test_a_turn_that_is_left_off_holds_nothing_and_sends_nothing_twice(bench, stays):
    photo = f"cw/{TWIN}/data/photo"
    for key, report in ((photo, a_photo(10)), (POSITION, a_pose(0.0)), (SCALE, ScaleReport(1.0, ONES))):
        bench.uplink.arrived(key, encode_report(report, 0))
    begun = bench.uplink.tick()
    for _ in range(stays):
        next(begun, None)
    begun.close()
    bench.turn(0.0)
    bench.uplink.arrived(photo, encode_report(a_photo(20), 0))
    bench.turn(0.1)
    assert [message["width"] for _, message in bench.of("camera/photo")] == [10, 20]
    assert len(bench.of("position")) == len(bench.of("scale")) == 1
    assert bench.uplink.sent.total == len(bench.sent)


def test_reports_of_which_nothing_is_known_become_no_message(bench):
    battery, joints = f"cw/{TWIN}/data/battery", f"cw/{TWIN}/data/joint_states"
    bench.forward({battery: BatteryReport(1.0, 50.0), joints: JointReport(1.0, {"hip": 0.5})})
    bench.clock.advance(1.0)
    bench.sent.clear()
    bench.forward({battery: BatteryReport(1.0), joints: JointReport(1.0, {})})
    assert (bench.sent, bench.uplink.refusals.counts()) == ([], {})


def test_reports_that_cross_together_are_what_each_would_be_by_itself(bench):
    batch = {
        POSITION: a_pose(1.0),
        f"cw/{TWIN}/data/joint_states": JointReport(1.0, {"null": 0.5}),
        f"cw/{TWIN}/data/battery": BatteryReport(1.0, 50.0),
        f"cw/{TWIN}/data/imu": ImuReport(1.0, Vector3(), Vector3()),
        STATUS: NavigationReport(1.0, "a", ActionState.RUNNING, 1.0),
    }
    bench.forward(batch)
    bench.turn()
    alone = Bench()
    for key, report in batch.items():
        alone.forward({key: report})
    alone.turn()
    by_leaf = operator.itemgetter(1)
    assert sorted(bench.sent, key=by_leaf) == sorted(alone.sent, key=by_leaf)
    assert bench.uplink.sent.by_class() == alone.uplink.sent.by_class()


def test_a_pose_that_came_too_early_crosses_when_its_time_is_there(bench, pose):
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn()
    bench.uplink.arrived(POSITION, pose(2.0))
    bench.turn()
    assert len(bench.of("position")) == 1
    bench.run(0.1)
    assert [message["position"]["x"] for _, message in bench.of("position")] == [1.0, 2.0]


@pytest.mark.parametrize(("channel", "suffixes"), CHANNEL_SUFFIXES.items())
def test_the_leaves_of_one_channel_have_one_rule(channel, suffixes):
    rules = {(RULES[suffix].traffic, RULES[suffix].max_rate, RULES[suffix].repeat) for suffix in suffixes}
    assert len(rules) == 1


def test_a_pose_is_said_again_while_the_robot_answers_and_only_then(bench, pose):
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.run(5.0)
    times = [when for when, _ in bench.of("position")]
    assert all(0.5 < later - earlier <= 1.0 for earlier, later in itertools.pairwise(times))
    assert bench.now - times[-1] < 1.0
    bench.alive = False
    before = len(bench.sent)
    bench.run(5.0)
    assert len(bench.sent) == before


def test_what_has_no_repeat_is_said_once(bench):
    key = f"cw/{TWIN}/data/metrics"
    bench.uplink.arrived(key, b'{"ts": 1.0, "power": {"voltage": 12.0}}')
    bench.run(20.0)
    assert len(bench.of("metrics")) == 1


def test_events_keep_their_order_and_are_all_sent(bench):
    for number in range(100):
        bench.uplink.arrived(STATUS, status(f"a{number % 2}", number % 100))
    bench.turn()
    assert [message["progress"] for _, message in bench.of("navigate/status")] == list(range(100))
    assert {qos for *_, qos in bench.sent} == {1}


def test_an_event_does_not_wait_for_a_turn_and_state_does(bench, pose):
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.uplink.arrived(STATUS, status("a"))
    assert [suffix for _, suffix, _, _ in bench.sent] == ["navigate/status"]


def test_a_flood_of_log_lines_is_thinned_and_reported_now_and_then(bench, caplog):
    for _ in range(100):
        for number in range(20):
            bench.uplink.arrived(LOG, line(f"line {number}"))
        bench.uplink.arrived(STATUS, status("a"))
        bench.turn(0.1)
    assert len(bench.of("navigate/status")) == 100, "the flood must not thin anything else"
    assert 100 <= len(bench.of("driverlog")) <= 110
    assert bench.uplink.dropped.total == 2000 - len(bench.of("driverlog"))
    assert len(caplog.records) <= 2


def test_a_few_log_lines_at_once_all_cross(bench):
    for number in range(8):
        bench.uplink.arrived(LOG, line(f"line {number}"))
    bench.turn()
    assert [message["message"] for _, message in bench.of("driverlog")] == [f"line {n}" for n in range(8)]


def test_the_twins_of_others_are_not_ours_to_tell(bench, pose):
    bench.uplink.arrived(f"cw/{OTHER}/data/position", pose(1.0))
    bench.turn()
    assert bench.sent == []
    assert bench.uplink.received.total == 0


def test_what_a_robot_of_ours_tells_nobody_else_on_the_bus_does(bench, pose, caplog):
    key = f"cw/{TWIN}/data/position"
    bench.uplink.arrived(key, pose(1.0))  # nobody tells it yet: a worker, or a program
    bench.turn()
    bench.forward({key: a_pose(2.0)})
    bench.run(1.0)
    for _ in range(3):
        bench.uplink.arrived(key, pose(66.0))
    bench.run(1.0)
    positions = [message["position"]["x"] for _, message in bench.of("position")]
    assert 2.0 in positions
    assert 66.0 not in positions
    assert bench.uplink.refusals.counts() == {"forged": 3}
    assert "refused position of" in caplog.text


def test_log_lines_and_metrics_of_a_robot_of_ours_may_come_from_others_too(bench):
    for channel in ("driverlog", "metrics"):
        key = f"cw/{TWIN}/data/{channel}"
        assert bench.uplink.open(key) is not None
        bench.uplink.arrived(
            key, line("theirs") if channel == "driverlog" else b'{"ts": 1, "wheel_slip": 0.5}'
        )
        bench.turn()
        assert bench.of(channel)
    assert bench.uplink.refusals.counts() == {}


def test_a_sensor_s_value_is_not_the_robot_s(bench, pose):
    bench.uplink.arrived(f"{POSITION}/gripper", pose(1.0))
    bench.turn()
    assert bench.sent == []


@pytest.mark.parametrize("channel", ["commands/velocity", "frames", "cloud/webrtc_offer", "alert", "x"])
def test_channels_without_a_rule_stay_on_the_bus(bench, channel):
    bench.uplink.arrived(f"cw/{TWIN}/data/{channel}", b"{}")
    bench.turn()
    assert bench.sent == []


@pytest.mark.parametrize("key", ["thermal", "thermal/front", "battery/second"])
def test_a_channel_that_no_rule_has_is_reported_once_and_counted(bench, caplog, key):
    for _ in range(10):
        bench.uplink.arrived(f"cw/{TWIN}/data/{key}", b"{}")
    assert bench.uplink.refusals.counts() == {"no rule": 1}
    assert "stays on the bus: no rule forwards it" in caplog.text


@pytest.mark.parametrize("key", ["commands/velocity", "frames", "frames/front", "cloud/position", "alert"])
def test_what_is_for_the_bus_alone_is_not_reported(bench, key):
    bench.uplink.arrived(f"cw/{TWIN}/data/{key}", b"{}")
    assert bench.uplink.refusals.counts() == {}


def test_what_fleet_yaml_switched_off_is_not_reported():
    bench = Bench(rulebook("satellite"))
    bench.uplink.arrived(f"cw/{TWIN}/data/imu", b"{}")
    assert bench.uplink.refusals.counts() == {}


def test_fields_that_do_not_cross_are_reported_by_name(bench, caplog):
    say(bench, "battery", {"charge_pct": 50.0, "cell_temperature": 31.5, "source_type": "edge"})
    bench.turn()
    assert bench.uplink.refusals.counts() == {"unknown fields": 1}
    assert "these fields are not forwarded: cell_temperature" in caplog.text
    assert bench.of("battery/status")[0][1]["percentage"] == 50.0


def test_invented_keys_do_not_fill_the_memory(bench, pose):
    for number in range(MOST_KEYS + 100):
        bench.uplink.arrived(f"cw/{number}/data/position", b"x")
    assert len(bench.uplink._channels) == MOST_KEYS
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn()
    assert len(bench.of("position")) == 1


def test_a_sample_that_cannot_be_read_is_counted_and_reported_once_a_minute(bench, caplog, pose):
    for _ in range(10):
        bench.uplink.arrived(POSITION, b"garbage")
        bench.run(2.0)
    assert bench.uplink.refusals.counts() == {"unreadable": 10}
    assert len(caplog.records) == 1
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn(60.0)
    bench.uplink.arrived(POSITION, b"garbage")
    bench.turn(1.0)
    assert len(bench.of("position")) == 1
    assert len(caplog.records) == 2
    assert "(9 more like this before)" in caplog.messages[-1]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(sorted(CHANNEL_SUFFIXES)),
            st.binary(max_size=60)
            | st.recursive(
                st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
                lambda inner: (
                    st.lists(inner, max_size=3)
                    | st.dictionaries(
                        st.sampled_from(
                            ["ts", "x", "names", "positions", "type", "fields", "level", "message"]
                        ),
                        inner,
                        max_size=5,
                    )
                ),
                max_leaves=6,
            ).map(lambda value: json.dumps(value).encode()),
        ),
        max_size=10,
    )
)
def test_no_garbage_on_the_bus_stops_the_uplink(samples):
    bench = Bench()
    for channel, sample in samples:
        bench.uplink.arrived(f"cw/{TWIN}/data/{channel}", sample)
        bench.turn(10.0)
    bench.uplink.arrived(BATTERY, battery(50.0))
    bench.turn(10.0)
    assert bench.of("battery/status")[-1][1]["percentage"] == 50.0


@given(st.lists(st.tuples(st.sampled_from(["pose", "battery"]), st.integers(0, 30)), max_size=60))
def test_no_sequence_of_arrivals_is_above_the_rate_or_loses_the_newest(arrivals):
    from_kind = {"pose": (POSITION, "position", 20.0), "battery": (BATTERY, "battery/status", 1.0)}
    bench = Bench()
    newest = {}
    for number, (kind, turns) in enumerate(arrivals):
        key = from_kind[kind][0]
        sample = (
            json.dumps({"ts": number, "x": 1, "y": 1, "z": 1, "qx": 0, "qy": 0, "qz": 0, "qw": 1})
            if kind == "pose"
            else json.dumps({"ts": number, "charge_pct": 50.0})
        )
        bench.uplink.arrived(key, sample.encode())
        newest[kind] = number
        bench.run(turns * TICK)
    bench.run(1.5)
    for kind, number in newest.items():
        _, suffix, rate = from_kind[kind]
        messages = bench.of(suffix)
        assert messages[-1][1]["timestamp"] == number
        stamps = [message["timestamp"] for _, message in messages]
        assert stamps == sorted(stamps), "an older value after a newer one"
        for (first, start), (last, end) in itertools.combinations(enumerate(when for when, _ in messages), 2):
            assert end - start >= (last - first - 0.5) * (1 / rate - SLACK) - 1e-6


@given(st.lists(st.floats(0.0, 0.02), min_size=20, max_size=200))
def test_a_source_of_just_its_rate_loses_nothing_by_turns_that_are_late(lateness):
    bench = Bench()
    begun = bench.now
    for number, late in enumerate(lateness):
        bench.clock.advance(max(0.0, begun + number * 0.05 - bench.now))
        sample = {"ts": number, "x": 1, "y": 1, "z": 1, "qx": 0, "qy": 0, "qz": 0, "qw": 1}
        bench.uplink.arrived(POSITION, json.dumps(sample).encode())
        bench.turn(late)
    bench.run(0.1)
    assert [message["timestamp"] for _, message in bench.of("position")] == list(range(len(lateness)))


@pytest.fixture
def hasty_threads():
    """Let threads take turns after every few instructions."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_what_arrives_during_a_turn_on_another_thread_is_never_forgotten(bench, pose, hasty_threads):
    """A sample that comes at any point of a turn leaves with that turn or a later one."""
    sample, last = pose(1.0), pose(2.0)
    done = threading.Event()

    def arrive():
        for _ in range(100_000):
            bench.uplink.arrived(POSITION, sample)
        bench.uplink.arrived(POSITION, last)
        done.set()

    thread = threading.Thread(target=arrive)
    thread.start()
    while not done.is_set():
        bench.turn(1.0)
    thread.join(DEADLINE)
    bench.run(0.1)
    assert bench.of("position")[-1][1]["position"]["x"] == 2.0


def test_a_sample_between_the_reading_of_the_queue_and_its_end_is_not_lost(bench, pose):
    """Forces the one order of events that threads meet by chance: arriving while a turn publishes."""
    publish = bench._publish
    late = [pose(2.0)]

    def publish_and_be_overtaken(*message):
        publish(*message)
        if late:
            bench.uplink.arrived(POSITION, late.pop())

    bench._publish = publish_and_be_overtaken
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.run(0.2)
    assert [message["position"]["x"] for _, message in bench.of("position")] == [1.0, 2.0]


def test_telemetry_crosses_with_its_own_fields(bench):
    report = TelemetryReport(1.0, "vehicle_state", {"armed": True})
    bench.uplink.arrived(f"cw/{TWIN}/data/telemetry", encode_report(report, 0))
    bench.turn()
    assert bench.of("telemetry")[0][1]["type"] == "vehicle_state"
    assert bench.of("telemetry")[0][1]["armed"] is True


def test_of_periodic_telemetry_the_newest_of_each_part_crosses(bench):
    for number in range(40):
        for motor in (1, 2):
            say(bench, "telemetry", {"type": "motor_status", "motor_id": motor, "n": number})
        say(bench, "telemetry", {"type": "vehicle_state", "n": number})
        say(bench, "telemetry", {"type": "camera_sync_frame", "frame_index": number})
        bench.turn(0.05)
    bench.run(1.0)
    messages = [(message, qos) for _, suffix, message, qos in bench.sent if suffix == "telemetry"]
    motors = [[m["n"] for m, _ in messages if m.get("motor_id") == motor] for motor in (1, 2)]
    assert [each[-1] for each in motors] == [39, 39]
    assert all(4 <= len(each) <= 7 for each in motors), "2 Hz"
    assert [m["n"] for m, _ in messages if m["type"] == "vehicle_state"][-1] == 39
    assert {qos for m, qos in messages if m["type"] == "vehicle_state"} == {0}
    assert [(m["frame_index"], qos) for m, qos in messages if m["type"] == "camera_sync_frame"] == [
        (number, 2) for number in range(40)
    ]


def test_the_metrics_of_a_program_are_not_lost_behind_the_robot_s_own(bench):
    for _ in range(50):
        bench.forward({METRICS: MetricsReport(1.0, power={"voltage": 12.0})})
        bench.turn()
    say(bench, "metrics", {"metrics": {"load": {"loaded": True}}})
    bench.forward({METRICS: MetricsReport(1.0, power={"voltage": 11.0})})
    bench.run(1.2)
    metrics = [message["metrics"] for _, message in bench.of("metrics")]
    assert {"load": {"loaded": True}} in metrics
    assert metrics[-1]["power"] == {"voltage": 11.0} or metrics[-2]["power"] == {"voltage": 11.0}


def test_invented_states_do_not_fill_the_memory(bench):
    for number in range(MOST_PARTS + 100):
        say(bench, "telemetry", {"type": "motor_status", "motor_id": number})
    bench.turn()
    assert len(bench.of("telemetry")) == MOST_PARTS
    assert bench.uplink.refusals.counts() == {"unreadable": 100}


def test_an_end_of_all_streams_does_not_cross_while_a_program_has_some(bench):
    say(bench, "telemetry", {"type": "telemetry_end"})
    say(bench, "webrtc_offer", {"type": "offer", "target": "backend", "sdp": "v=0"})
    say(bench, "telemetry", {"type": "telemetry_end"})
    say(bench, "telemetry", {"type": "telemetry_end", "sensor": "front"})
    assert [message.get("sensor") for _, message in bench.of("telemetry")] == [None, "front"]
    assert bench.uplink.refusals.counts() == {"unreadable": 1}


def test_a_new_connection_hears_at_once_how_everything_is(bench, pose):
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn()
    bench.uplink.arrived(STATUS, status(0))
    bench.turn()
    before = len(bench.sent)
    bench.uplink.publish_newest()
    assert sorted(suffix for _, suffix, _, _ in bench.sent[before:]) == ["position", "rotation"]
    bench.alive = False
    bench.uplink.publish_newest()
    assert len(bench.sent) == before + 2


# -- topics that are more than a report ---------------------------------------------------------------


def test_a_depth_image_crosses_as_a_base64_object_with_its_sensor(bench):
    report = DepthReport(2.0, b"\x01\x02\x03\x04", 2, 1, "uint16")
    bench.uplink.arrived(f"cw/{TWIN}/data/depth/front", encode_report(report, 0))
    bench.turn()
    ((_, message),) = bench.of("depth")
    assert message["data"] == {"depth_binary": "AQIDBA==", "width": 2, "height": 1, "dtype": "uint16"}
    assert (message["type"], message["sensor_id"], message["timestamp"]) == ("depth_data", "front", 2.0)


def test_two_sensors_do_not_conflate_each_other(bench):
    for sensor in ("front", "rear"):
        sample = encode_report(PointCloudReport(2.0, b"\0" * 24, 3), 0)
        bench.uplink.arrived(f"cw/{TWIN}/data/pointcloud/{sensor}", sample)
    bench.turn()
    assert [message["sensor_id"] for _, message in bench.of("pointcloud")] == ["front", "rear"]
    assert {message["rows"] for _, message in bench.of("pointcloud")} == {2}


def test_invented_sensors_do_not_fill_the_memory(bench):
    for number in range(MOST_KEYS + 10):
        bench.uplink.arrived(f"cw/{TWIN}/data/imu/s{number}", b"x")
    assert len(bench.uplink._channels) == MOST_KEYS


def test_streams_are_dropped_while_the_way_is_full_and_state_is_not(bench, pose):
    bench.queued_bytes = 4 * KIB * KIB
    bench.uplink.arrived(f"cw/{TWIN}/data/depth", encode_report(DepthReport(2.0, b"\0\0", 1, 1, "uint16"), 0))
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn()
    assert {suffix for _, suffix, _, _ in bench.sent} == {"position", "rotation"}
    assert bench.uplink.dropped.by_class() == dict.fromkeys(("reply", "status", "event", "latest"), 0) | {
        "stream": 1
    }


def test_while_the_network_takes_nothing_only_the_newest_of_a_state_waits_and_goes_when_it_does(bench):
    bench.run(2.0)
    bench.full = True
    bench.turn()
    for x in range(50):
        bench.forward({POSITION: a_pose(x)})
        bench.uplink.arrived(BATTERY, battery(float(x)))
        bench.turn(1.0)
    assert bench.sent == []
    bench.full = False
    bench.turn()
    assert [message["position"]["x"] for _, message in bench.of("position")] == [49.0]
    assert [message["percentage"] for _, message in bench.of("battery/status")] == [49.0]


def test_while_the_network_takes_nothing_events_are_still_kept_and_streams_dropped(bench):
    bench.full = True
    bench.uplink.arrived(STATUS, status("a1"))
    bench.uplink.arrived(f"cw/{TWIN}/data/depth", encode_report(DepthReport(2.0, b"\0\0", 1, 1, "uint16"), 0))
    bench.turn()
    bench.full = False
    bench.turn()
    assert [suffix for _, suffix, _, _ in bench.sent] == ["navigate/status"]
    assert bench.uplink.dropped.by_class()["stream"] == 1


def test_a_parked_robot_s_state_is_not_repeated_into_a_network_that_takes_nothing(bench):
    bench.uplink.arrived(POSITION, encode_report(a_pose(1), 0))
    bench.turn()
    bench.sent.clear()
    bench.full = True
    bench.run(5.0)
    assert bench.sent == []
    bench.full = False
    bench.run(0.5)
    assert len(bench.of("position")) == 1


def test_a_satellite_link_counts_less_as_full():
    bench = Bench(rulebook("satellite", [RuleChanges({"imu": RuleChange(on=True)})]))
    bench.queued_bytes = 32 * KIB
    bench.uplink.arrived(
        f"cw/{TWIN}/data/imu", b'{"ts":1,"accel":{"x":0,"y":0,"z":0},"gyro":{"x":0,"y":0,"z":0}}'
    )
    bench.turn()
    assert bench.sent == []


def test_what_is_larger_than_its_rule_is_refused_and_counted(bench, caplog):
    picture = PhotoReport(1.0, b"x" * (7 * 1024 * KIB), "jpeg", 10, 10)
    bench.uplink.arrived(f"cw/{TWIN}/data/photo", encode_report(picture, 0))
    bench.turn()
    assert bench.sent == []
    assert bench.uplink.refusals.counts() == {"too large": 1}
    assert "are more than the 8388608 of its rule" in caplog.text


@pytest.mark.parametrize(
    ("channel", "suffix", "fields", "qos"),
    [
        ("webrtc_offer", "webrtc-offer", {"type": "offer", "target": "backend", "sdp": "v=0"}, 2),
        ("webrtc_candidate", "webrtc-candidate", {"type": "candidate", "target": "x", "candidate": {}}, 1),
        ("event", "event", {"event_type": "fall", "data": {}}, 1),
        ("map_update", "map_update", {"map_type": "point_cloud", "pointcloud": []}, 1),
        ("model_output", "model_output", {"label": "cat"}, 0),
    ],
)
def test_documents_cross_with_their_own_fields_and_a_stamp(bench, channel, suffix, fields, qos):
    bench.uplink.arrived(f"cw/{TWIN}/data/{channel}", json.dumps({**fields, "ts": 5.0}).encode())
    bench.turn()
    ((_, sent, message, given),) = bench.sent
    assert (sent, given) == (suffix, qos)
    assert fields.items() <= message.items()
    assert message["timestamp"] == 5.0


def test_an_update_of_an_environment_goes_to_its_own_topic():
    topics = []
    bench = Bench(environments=[OTHER])
    bench._publish = lambda topic, _qos, payload: topics.append((topic, json.loads(payload)))
    bench.uplink.arrived(f"cw/{OTHER}/data/environment/twin_added", b'{"ts": 5, "data": {"a": 1}}')
    bench.uplink.arrived(f"cw/{OTHER}/data/environment/twin_removed", b'{"ts": 5}')
    bench.uplink.arrived(f"cw/{OTHER}/data/position", b"{}")
    bench.uplink.arrived(f"cw/{TWIN}/data/environment/update", b'{"ts": 5}')
    bench.turn()
    (topic, message), (other, removed) = topics
    assert topic == f"cyberwave/environment/{OTHER}/twin_added"
    assert (other, removed["type"]) == (f"cyberwave/environment/{OTHER}/twin_removed", "twin_removed")
    assert (message["type"], message["data"], message["timestamp"]) == ("twin_added", {"a": 1}, 5)


def test_joints_cross_in_the_layout_that_fleet_yaml_asks_for():
    bench = Bench(rulebook("lan", [RuleChanges({"joint:update": RuleChange(layout="single")})]))
    bench.uplink.arrived(f"cw/{TWIN}/data/joint_states", encode_report(JointReport(1.0, {"a": 1, "b": 2}), 0))
    bench.turn()
    messages = [message for _, topic, message, _ in bench.sent]
    assert [message["joint_name"] for message in messages] == ["a", "b"]


def test_scale_crosses_and_is_said_again(bench):
    bench.uplink.arrived(f"cw/{TWIN}/data/scale", encode_report(ScaleReport(1.0, Vector3(1, 1, 2)), 0))
    bench.run(3.0)
    messages = bench.of("scale")
    assert messages[0][1]["scale"] == {"x": 1, "y": 1, "z": 2}
    assert len(messages) >= 3


# -- rules of fleet.yaml ------------------------------------------------------------------------------


def joints():
    return encode_report(JointReport(1.0, {"hip": 0.5}), 0)


def test_the_older_joints_topic_is_sent_when_it_is_asked_for():
    for on, suffixes in ((None, {"joint:update"}), (True, {"joint:update", "joint_states"})):
        bench = Bench(rulebook("lan", [RuleChanges({"joint_states": RuleChange(on=on)})]))
        topics = set()
        bench._publish = lambda topic, *_, topics=topics: topics.add(topic)
        bench.uplink.arrived(f"cw/{TWIN}/data/joint_states", joints())
        bench.turn()
        assert topics == {Topics("").twin(TWIN, suffix) for suffix in suffixes}


def test_a_topic_that_is_off_does_not_cross_and_its_sibling_does(pose):
    bench = Bench(rulebook("lan", [RuleChanges({"rotation": RuleChange(on=False)})]))
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.turn()
    assert [suffix for _, suffix, _, _ in bench.sent] == ["position"]


@pytest.mark.parametrize(("profile", "most"), [("lan", 20), ("lte", 5), ("satellite", 1.5)])
def test_each_profile_has_its_own_rate_of_poses_and_never_less_than_one_a_second(pose, profile, most):
    bench = Bench(rulebook(profile))
    for number in range(200):
        bench.uplink.arrived(POSITION, pose(number))
        bench.turn(0.05)
    assert max(10, 0.6 * most * 10) <= len(bench.of("position")) <= most * 10 + 1


def test_an_event_of_a_worker_crosses_in_the_clouds_form_and_what_is_for_the_history_does_not(bench):
    for kind in (EventKind.COMMAND, EventKind.LOST):
        event = EventReport(4.0, kind, "the link fell", data={"reason": "unplugged"})
        bench.uplink.arrived(f"cw/{TWIN}/data/event", encode_report(event, 1))
    ((_, message),) = bench.of("event")
    assert message["event_type"] == "lost"
    assert message["timestamp"] == 4.0
    assert message["data"] == {"reason": "unplugged", "text": "the link fell", "severity": "info"}


def test_an_event_that_is_made_latest_is_conflated():
    change = RuleChange(traffic=TrafficClass.LATEST, rate=1.0)
    bench = Bench(rulebook("lan", [RuleChanges({"event": change})]))
    for number in range(5):
        sample = json.dumps({"event_type": "x", "ts": number}).encode()
        bench.uplink.arrived(f"cw/{TWIN}/data/event", sample)
    bench.turn()
    assert [(message["timestamp"], qos) for _, _, message, qos in bench.sent] == [(4, 0)]


def test_an_unknown_channel_crosses_by_an_explicit_rule():
    bench = Bench(
        rulebook("lan", (), {"thermal": ExtraChannel("sensors/thermal", TrafficClass.LATEST, 1.0, 0.0, 100)})
    )
    bench.uplink.arrived(f"cw/{TWIN}/data/thermal", b'{"ts": 1, "celsius": 40}')
    bench.uplink.arrived(f"cw/{TWIN}/data/thermal/left", b'{"ts": 1, "celsius": 41}')
    bench.turn()
    assert {(suffix, message["celsius"]) for _, suffix, message, _ in bench.sent} == {
        ("sensors/thermal", 40),
        ("sensors/thermal/left", 41),
    }


def test_nothing_is_said_of_a_twin_that_another_edge_has(bench, pose):
    bench.uplink.held = frozenset({TWIN})
    bench.uplink.arrived(POSITION, pose(1.0))
    bench.run(2.0)
    assert bench.sent == []
    bench.uplink.held = frozenset()
    bench.run(2.0)
    assert bench.of("position")


def test_of_a_flood_of_events_of_our_own_the_cloud_hears_a_few_and_of_what_is_asked_none(bench):
    key = f"cw/{TWIN}/data/event"
    for _ in range(50):
        bench.forward({key: EventReport(4.0, EventKind.COMMAND, "drive")})
        bench.forward({key: EventReport(4.0, EventKind.SEPARATION, "held")})
    bench.forward({key: EventReport(4.0, EventKind.EMERGENCY_STOP, "stopped")})
    assert [message["event_type"] for _, message in bench.of("event")] == ["separation"] * 6 + [
        "emergency_stop"
    ]


FORGED = EventReport(
    4.0,
    EventKind.EMERGENCY_STOP,
    "forged",
    asker=Requester(Transport.LOCAL, "anna", proven=True),
    command="emergency_stop",
)


def test_nobody_on_the_bus_tells_events_of_our_own_robot_in_the_fleets_name(bench):
    key = f"cw/{TWIN}/data/event"
    bench.uplink.refuse_bus_events([TWIN])
    for number in range(12):
        bench.uplink.arrived(key, encode_report(FORGED, number))
    bench.uplink.arrived(key, b'{"ts": 1, "event_type": "fall", "source": "camera", "data": {}}')
    bench.forward({key: EventReport(5.0, EventKind.EMERGENCY_STOP, "true")})
    events = [(message["event_type"], message["data"].get("text")) for _, message in bench.of("event")]
    assert events == [("fall", None), ("emergency_stop", "true")]
    assert bench.uplink.refusals.counts() == {"forged": 12}


def test_who_asked_is_never_proven_by_what_is_said_on_the_bus(bench):
    bench.uplink.arrived(f"cw/{TWIN}/data/event", encode_report(FORGED, 1))
    ((_, message),) = bench.of("event")
    assert message["data"]["asker"] == {"way": "local", "name": "anna"}


def test_what_the_bus_says_of_a_workers_robot_takes_no_room_from_our_own_events(bench):
    key = f"cw/{TWIN}/data/event"
    for number in range(12):
        bench.uplink.arrived(key, encode_report(FORGED, number))
    bench.forward({key: EventReport(5.0, EventKind.EMERGENCY_STOP, "true")})
    assert bench.of("event")[-1][1]["data"]["text"] == "true"


def test_a_clock_that_is_set_back_silences_no_event(bench):
    key = f"cw/{TWIN}/data/event"
    for _ in range(3):
        bench.clock.step(-3600.0)
        for _ in range(6):
            bench.forward({key: EventReport(4.0, EventKind.SEPARATION, "held")})
        bench.clock.advance(61.0)
    assert len(bench.of("event")) == 18
