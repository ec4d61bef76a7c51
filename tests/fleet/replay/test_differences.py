"""What counts as a difference between two rows of reports."""

import pytest

from fleet.replay.differences import differences, unequal
from fleet.replay.recorded_robot import RecordedReport


def found(recorded, now, **bounds):
    return [f"{each.channel} {each.what}" for each in differences("rex", recorded, now, **bounds)]


def test_the_same_within_a_tick_is_no_difference():
    assert (
        found({"battery": [RecordedReport(10.0, {"p": 5})]}, {"battery": [RecordedReport(10.019, {"p": 5})]})
        == []
    )


def test_the_same_a_tick_later_is_one():
    (what,) = found(
        {"battery": [RecordedReport(10.0, {"p": 5})]}, {"battery": [RecordedReport(10.03, {"p": 5})]}
    )
    assert "is not reported now" in what


def test_of_several_in_one_tick_the_recorder_has_one():
    now = {"battery": [RecordedReport(10.0, {"p": 5}), RecordedReport(10.01, {"p": 4})]}
    assert found({"battery": [RecordedReport(10.01, {"p": 4})]}, now) == []


def test_each_member_that_differs_is_named():
    recorded, now = {"a": {"b": [1, 2]}, "c": "x"}, {"a": {"b": [1, 3]}, "d": 1}
    assert list(unequal(recorded, now)) == [
        "a.b[1]: recorded 2, now 3",
        "c: recorded 'x', now None",
        "d: recorded None, now 1",
    ]


@pytest.mark.parametrize(
    ("one", "other", "same"), [(1.0, 1.0000001, True), (1.0, 1.001, False), (1, True, True)]
)
def test_numbers_are_the_same_to_a_millionth(one, other, same):
    assert (list(unequal(one, other)) == []) is same


def test_what_the_host_alone_reported_is_no_difference():
    assert found({"telemetry:connected": [RecordedReport(1.0, {})]}, {}) == []


def test_an_event_that_was_not_recorded_is_one():
    (what,) = found(
        {"driverlog": [RecordedReport(1.0, {"message": "a"})]},
        {"driverlog": [RecordedReport(1.0, {"message": "b"})]},
    )
    assert "was not recorded: {'message': 'b'}" in what


def test_what_was_before_is_left_out():
    assert found({"battery": [RecordedReport(10.0, {"p": 5})]}, {}, since=11.0) == []
