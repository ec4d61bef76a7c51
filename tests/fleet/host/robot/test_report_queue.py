from collections import deque

import pytest

from fleet.bus.zenoh_session import Query, ZenohSession
from fleet.host.robot.report_queue import WAITING, ReportQueue
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import BatteryReport, DepthReport, LogReport, NavigationReport, PoseReport
from fleet.wire.databus import decode_report, encode_report
from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
PEER = {"mode": "peer", "scouting/multicast/enabled": False}


@pytest.fixture
def place(tmp_path):
    return f"unixsock-stream/{tmp_path}/bus"


@pytest.fixture
def bus_session(place):
    bus_session = ZenohSession(PEER | {"listen/endpoints": [place]})
    yield bus_session
    bus_session.close()


@pytest.fixture
def ear(outbox, place):
    """Make another's lane, on which all that is put is heard: (key, sample); ``heard.when(n)`` waits."""
    ear = ZenohSession(PEER | {"listen/endpoints": [], "connect/endpoints": [place]})
    heard = Heard()
    ear.subscribe("cw/**", lambda key, sample: heard.append((key, sample)))
    wait_until("the subscription is known", lambda: outbox._publishers._any.wanted)
    yield heard
    ear.close()


class Heard(list):
    def when(self, number):
        """Return (key, report) of what was heard, once it is so much and no more."""
        wait_until(f"{number} samples", lambda: len(self) >= number)
        assert len(self) == number
        return [(key, decode_report(key.split("/")[3], sample)) for key, sample in self]


@pytest.fixture
def outbox(bus_session):
    return ReportQueue(bus_session)


@pytest.fixture
def put(outbox):
    """Put a report of a twin."""
    senders = {}
    return lambda twin, report: senders.setdefault(twin, outbox.sender(twin))(report)


class Bridge:
    """A bridge of this process that notes what crosses; it fails at one report."""

    def __init__(self, fails_at=None):
        self.crossed = []
        self._fails_at = fails_at

    def open(self, key):
        return key

    def forward(self, batch):
        if any(report == self._fails_at for _, report in batch):
            raise ZeroDivisionError
        self.crossed += batch


@pytest.fixture
def crossed(outbox):
    """Return what the bridge of this process gets: (key, report)."""
    outbox.bridge = Bridge()
    return outbox.bridge.crossed


def pose(x):
    return PoseReport(1.0, Vector3(x, 0.0, 0.0), Quaternion())


def running(progress):
    return NavigationReport(1.0, "a1", ActionState.RUNNING, progress)


def test_nothing_leaves_before_the_flush(outbox, put, ear):
    put(TWIN, pose(1.0))
    assert ear == []
    outbox.flush()
    assert ear.when(1) == [(f"cw/{TWIN}/data/position", pose(1.0))]
    outbox.flush()
    put(OTHER, pose(2.0))
    outbox.flush()
    assert ear.when(2)[-1] == (f"cw/{OTHER}/data/position", pose(2.0))


def test_what_nobody_listens_to_is_not_put_but_the_bridge_gets_it_and_who_asks(
    outbox, put, crossed, bus_session
):
    put(TWIN, pose(1.0))
    outbox.flush()
    assert crossed == [(f"cw/{TWIN}/data/position", pose(1.0))]
    ((_, sample),) = bus_session.request(crossed[0][0], b"", timeout=60.0)
    assert decode_report("position", sample) == pose(1.0)


def test_of_a_state_only_the_newest_of_a_turn_leaves(outbox, put, ear):
    for x in range(5):
        put(TWIN, pose(x))
        put(OTHER, pose(-x))
    outbox.flush()
    assert ear.when(2) == [(f"cw/{TWIN}/data/position", pose(4.0)), (f"cw/{OTHER}/data/position", pose(-4.0))]


def test_every_event_leaves_in_order(outbox, put, ear):
    for number in range(50):
        put(TWIN, running(number))
    outbox.flush()
    assert [report.progress for _, report in ear.when(50)] == list(range(50))


def test_what_a_flush_that_was_left_in_the_middle_still_had_leaves_first(outbox, put, crossed):
    for number in range(5):
        put(TWIN, running(number))
    put(TWIN, pose(1.0))
    begun = outbox.flushing()
    next(begun)
    next(begun)
    put(TWIN, running(5))
    outbox.flush()
    assert [getattr(report, "progress", "pose") for _, report in crossed] == [0, 1, 2, 3, 4, 5, "pose"]
    assert list(begun) == []


def test_what_fails_on_its_way_to_the_bridge_takes_nothing_with_it(outbox, put):
    outbox.bridge = bridge = Bridge(fails_at=running(0))
    for report in (running(0), pose(1.0), BatteryReport(1.0, 50.0), running(1)):
        put(TWIN, report)
    with pytest.raises(ZeroDivisionError):
        outbox.flush()
    outbox.flush()
    assert [report for _, report in bridge.crossed] == [running(1), pose(1.0), BatteryReport(1.0, 50.0)]
    for again in (pose(2.0), running(2)):
        put(TWIN, again)
        outbox.flush()
        assert bridge.crossed[-1][1] == again


@pytest.mark.parametrize(("queue", "report"), [("states", pose), ("eventful", running)])
def test_a_report_that_an_adapter_s_thread_puts_while_the_loop_flushes_leaves_too(
    outbox, put, crossed, queue, report
):
    class Preempted(deque):
        def append(self, item):
            super().append(item)
            outbox.flush()  # the loop has its turn between the steps of the thread

    setattr(outbox, queue, Preempted())
    for number in range(3):
        put(TWIN, report(number))
        outbox.flush()
    assert [sent for _, sent in crossed] == [report(number) for number in range(3)]


def test_a_robot_that_floods_loses_its_own_events_and_nobody_else_s(outbox, put, ear):
    flood = outbox.sender(TWIN)
    for number in range(WAITING + 7):
        flood(LogReport(1.0, "WARNING", str(number)))
    put(OTHER, running(1.0))
    outbox.flush()
    assert outbox.dropped == 7
    assert ear.when(WAITING + 1)[-1] == (f"cw/{OTHER}/data/navigate_status", running(1.0))
    flood(LogReport(1.0, "WARNING", "after"))
    outbox.flush()
    assert ear.when(WAITING + 2)[-1][1].message == "after"


@pytest.mark.parametrize(
    "bad", [pose(float("nan")), PoseReport(1.0, None, None), BatteryReport("x", object())]
)
def test_a_report_that_cannot_be_said_is_dropped_and_takes_none_with_it(outbox, put, ear, caplog, bad):
    for _ in range(3):
        put(TWIN, bad)
        put(OTHER, pose(1.0))
        outbox.flush()
    assert [key for key, _ in ear.when(3)] == [f"cw/{OTHER}/data/position"] * 3
    assert outbox.dropped == 3
    assert len(caplog.records) == 1
    assert f"a report on cw/{TWIN}/data/{bad.channel} was dropped" in caplog.text


@pytest.mark.parametrize("bad", [None, "text"])
def test_a_report_of_wrong_types_reaches_neither_bus_nor_bridge(outbox, put, crossed, caplog, bad):
    put(TWIN, PoseReport(1.0, Vector3(bad, 0.0, 0.0), Quaternion()))
    outbox.flush()
    assert crossed == []
    assert (outbox.dropped, len(caplog.records)) == (1, 1)


def test_a_robot_that_recovers_is_reported_again_when_it_fails_again(outbox, put, ear, caplog):
    for x in (float("nan"), 1.0, float("nan")):
        put(TWIN, pose(x))
        outbox.flush()
    assert len(caplog.records) == 2


def test_whoever_asks_gets_the_last_of_each_channel(outbox, put, bus_session):
    for x in (1.0, 2.0):
        put(TWIN, pose(x))
        put(OTHER, pose(-x))
        put(TWIN, BatteryReport(1.0, 50.0 + x))
        outbox.flush()
    last = dict(bus_session.request(f"cw/{TWIN}/data/**", b"", timeout=60.0))
    assert {key: decode_report(key.split("/")[3], sample) for key, sample in last.items()} == {
        f"cw/{TWIN}/data/position": pose(2.0),
        f"cw/{TWIN}/data/battery": BatteryReport(1.0, 52.0),
    }
    assert len(list(bus_session.request("cw/*/data/position", b"", timeout=60.0))) == 2


def test_a_report_that_cannot_be_encoded_keeps_the_asker_from_no_other(
    outbox, put, bus_session, monkeypatch, caplog
):
    def encode(report, sequence):
        if isinstance(report, PoseReport):
            raise OverflowError("too far away")
        return encode_report(report, sequence)

    put(TWIN, pose(1.0))
    put(TWIN, BatteryReport(1.0, 50.0))
    outbox.flush()
    monkeypatch.setattr("fleet.host.robot.report_queue.encode_report", encode)
    answers = dict(bus_session.request(f"cw/{TWIN}/data/**", b"", timeout=60.0))
    assert list(answers) == [f"cw/{TWIN}/data/battery"]
    assert "too far away" in caplog.text


def test_who_asks_waits_for_nothing_though_answering_fails(outbox, put, bus_session, monkeypatch):
    put(TWIN, pose(1.0))
    outbox.flush()
    monkeypatch.setattr("fleet.host.robot.report_queue.keys_intersect", lambda one, other: 1 / 0)
    questions = []
    closed = Query.close
    monkeypatch.setattr(Query, "close", lambda question: (questions.append(question), closed(question)))
    assert list(bus_session.request(f"cw/{TWIN}/data/**", b"", timeout=60.0)) == []
    assert len(questions) == 1


def test_the_samples_of_a_channel_are_numbered_without_gaps(outbox, put, ear):
    for x in (1.0, float("nan"), 2.0):
        put(TWIN, pose(x))
        outbox.flush()
    ear.when(2)
    assert [int.from_bytes(sample[12:20], "little") for _, sample in ear] == [0, 1]


def test_two_sensors_of_a_robot_have_a_key_each(outbox, put, ear):
    for sensor in ("front", "rear", ""):
        put(TWIN, DepthReport(1.0, b"xx", 1, 1, "uint16", sensor))
    outbox.flush()
    keys = [key.removeprefix(f"cw/{TWIN}/data/") for key, _ in ear.when(3)]
    assert keys == ["depth/front", "depth/rear", "depth"]


@pytest.mark.parametrize("sensor", ["Front", "a/b", "*", "**", 5])
def test_a_sensor_that_cannot_be_part_of_a_key_is_dropped_and_reported(outbox, put, ear, caplog, sensor):
    for _ in range(2):
        put(TWIN, DepthReport(1.0, b"xx", 1, 1, "uint16", sensor))
        put(TWIN, pose(1.0))
        outbox.flush()
    assert [key for key, _ in ear.when(2)] == [f"cw/{TWIN}/data/position"] * 2
    assert outbox.dropped == 2
    assert caplog.text.count(f"the depth reports of {TWIN} are dropped") == 1
