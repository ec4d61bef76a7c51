"""The parts of the contract tests find what they are for, and nothing in what is right."""

import math
import threading
from typing import Annotated, Literal

import msgspec
import pytest

from fleet.adapter import FrameAdapter
from fleet.commands import CommandSpec, Range
from fleet.errors import NotReady
from fleet.model.geometry import Quaternion, Vector3, Velocity
from fleet.model.report import BatteryReport, PoseReport
from fleet.testing import probes
from fleet.testing.probes import (
    containers_of,
    corrupted_frames,
    implausible,
    in_time,
    least_data,
    near,
    numbers_in,
    unless_refused,
)

NOW = 1_795_867_200.0


def raises(error):
    raise error


def test_work_is_done_on_another_thread_with_its_result_or_error():
    assert in_time(threading.current_thread) is not threading.current_thread()
    assert in_time(divmod, 7, 2) == (3, 1)
    with pytest.raises(SystemExit):
        in_time(raises, SystemExit(1))


def test_work_that_blocks_is_found(monkeypatch):
    monkeypatch.setattr(probes, "SOON", 0.01)
    go = threading.Event()
    with pytest.raises(AssertionError, match="blocks"):
        in_time(go.wait, 20)
    go.set()


def test_a_refusal_is_no_error_and_any_other_exception_is():
    assert unless_refused(lambda: 7) == 7
    assert unless_refused(raises, NotReady("not now")) is None
    with pytest.raises(ZeroDivisionError):
        unless_refused(raises, ZeroDivisionError())


def test_frames_are_broken_in_every_way_and_the_same_each_time():
    frame = b"B80,1.5"
    broken = list(corrupted_frames([frame]))
    assert broken == list(corrupted_frames([frame]))
    for each in (b"", b"B8", b"0,1.5", frame * 2, b"Bnan,nan", b"Binf,inf", b"B1e999,1e999", b"B-,-"):
        assert each in broken
    flipped = [each for each in broken if len(each) == len(frame) and each not in (frame, b"Bnan,nan")]
    assert any(sum(a != b for a, b in zip(each, frame, strict=True)) == 1 for each in flipped)
    assert len({len(each) for each in corrupted_frames([])}) == 200, "noise of every length"


def test_numbers_are_found_at_any_depth_and_a_truth_value_is_none():
    report = PoseReport(1.0, Vector3(2.0, 3.0, 4.0), Quaternion(1.0, 0.0, 0.0, 0.0))
    assert sorted(numbers_in(report)) == sorted([1.0, 2.0, 3.0, 4.0, 1.0, 0.0, 0.0, 0.0])
    assert list(numbers_in({"a": [1, (2.5, "3", None)], "b": True})) == [1, 2.5]


@pytest.mark.parametrize(
    ("report", "words"),
    [
        (BatteryReport(NOW, percent=80.0), ""),
        (BatteryReport(NOW, percent=0.0), ""),
        (BatteryReport(NOW, percent=100.0), ""),
        (BatteryReport(NOW, percent=100.1), "BatteryReport.percent is [100.1], beyond 0 to 100"),
        (BatteryReport(NOW, percent=-0.1), "BatteryReport.percent is [-0.1], beyond 0 to 100"),
        (BatteryReport(NOW, percent=80.0, voltage=24_000.0), "BatteryReport.voltage is [24000.0]"),
        (BatteryReport(NOW, percent=math.nan), "has a number that is not finite"),
        (BatteryReport(NOW - 3600.0, percent=80.0), ""),
        (BatteryReport(NOW - 3601.0, percent=80.0), "BatteryReport has the stamp"),
        (BatteryReport(12.5, percent=80.0), "give Unix seconds of robot.clock.time()"),
        (PoseReport(NOW, Vector3(2e6, 0.0, 0.0), Quaternion()), "PoseReport.position is"),
        (PoseReport(NOW, Vector3(), Quaternion(90.0, 0.0, 0.0, 0.0)), "PoseReport.rotation is"),
    ],
)
def test_an_impossible_measurement_is_found_with_what_may_be_wrong(report, words):
    found = implausible(report, NOW)
    assert words in found
    assert bool(found) is bool(words)


@pytest.mark.parametrize(
    ("velocity", "close"),
    [
        (Velocity(Vector3(1.0)), True),
        (Velocity(Vector3(1.34)), True),
        (Velocity(Vector3(1.36)), False),
        (Velocity(Vector3(0.66)), True),
        (Velocity(Vector3(-1.0)), False),
        (Velocity(Vector3(1.0, 0.04)), True),
        (Velocity(Vector3(1.0, 0.06)), False),
        (Velocity(Vector3(1.0, 0.0, 0.06)), False),
        (Velocity(Vector3(1.0), 0.06), False),
        (None, False),
    ],
)
def test_a_velocity_is_near_within_a_third_on_every_axis(velocity, close):
    assert near(velocity, Velocity(Vector3(1.0))) is close


class Parameters(msgspec.Struct):
    """Parameters of a command, of every kind."""

    number: float
    count: Annotated[int, "unit"]
    bounded: float
    open: float
    word: Literal["slow", "fast"]
    points: list[float]
    left_out: int = 7


def test_the_least_data_of_a_command_are_its_required_parameters_at_their_lowest():
    ranges = {"bounded": Range(1.5, 9.0, "m"), "open": Range(-math.inf, 9.0, "m")}
    spec = CommandSpec("go", "go", 1.0, False, True, False, Parameters, "", ranges=ranges)
    assert least_data(spec) == {
        "number": 0.0,
        "count": 0,
        "bounded": 1.5,
        "open": 0,
        "word": "slow",
        "points": [],
    }


class Toy(FrameAdapter):
    """An adapter with state of its own, and some that all robots of its kind share."""

    BAYS = {1: "a"}
    names = {}
    queue = []
    limit = 3

    def __init__(self):
        self.own, self.number = [], 7

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return ()


def test_containers_of_a_robot_and_of_its_class_are_found_and_no_constants():
    toy = Toy()
    assert containers_of(toy) == {id(toy.own), id(Toy.names), id(Toy.queue)}
    assert containers_of(toy) & containers_of(Toy()) == {id(Toy.names), id(Toy.queue)}
    outer = Toy()
    outer.inner = toy
    assert containers_of(outer) >= containers_of(toy)
