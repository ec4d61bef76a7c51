"""A report whose fields are not of their types is refused, whatever is in them."""

import contextlib
import math

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import BatteryReport, ImuReport, JointReport, JointTags, PoseReport
from fleet.wire.checks import check_report

NUMBERS = st.floats()
JUNK = NUMBERS | st.integers() | st.booleans() | st.none() | st.text(max_size=3) | st.just([]) | st.just({})
MOSTLY_NUMBERS = st.one_of(*[NUMBERS] * 30, JUNK)  # so that now and then all of many fields are
VECTORS = st.builds(Vector3, MOSTLY_NUMBERS, MOSTLY_NUMBERS, MOSTLY_NUMBERS)
TURNS = st.builds(Quaternion, MOSTLY_NUMBERS, MOSTLY_NUMBERS, MOSTLY_NUMBERS, MOSTLY_NUMBERS)
NAMED = st.dictionaries(
    st.text(max_size=3) | JUNK.filter(lambda key: key.__hash__), MOSTLY_NUMBERS, max_size=4
)
REPORTS = st.one_of(
    st.builds(
        PoseReport, MOSTLY_NUMBERS, VECTORS | TURNS | JUNK, TURNS | VECTORS | JUNK, st.just("map") | JUNK
    ),
    st.builds(ImuReport, MOSTLY_NUMBERS, VECTORS | TURNS | JUNK, VECTORS | JUNK),
    st.builds(
        JointReport,
        MOSTLY_NUMBERS,
        NAMED | JUNK,
        st.just({}) | NAMED | JUNK,
        st.just({}) | JUNK,
        st.none() | st.builds(JointTags, JUNK, JUNK) | JUNK,
    ),
    st.builds(BatteryReport, MOSTLY_NUMBERS, JUNK, JUNK, JUNK),
)


def refused(report):
    """Tell whether a report is refused."""
    try:
        check_report(report)
    except WireError:
        return True
    return False


def fits(report):
    """Tell whether msgspec, which wrote the rules down, reads back what it packs."""
    with contextlib.suppress(msgspec.MsgspecError, TypeError, OverflowError):
        msgspec.msgpack.decode(msgspec.msgpack.encode(report), type=type(report))
        return True
    return False


@given(REPORTS)
@example(PoseReport(1.0, Vector3(1.0, 2.0, 3.0), Quaternion()))
@example(PoseReport(1.0, Quaternion(), Quaternion()))
@example(PoseReport(1.0, Vector3(1.0, 2.0, 3.0), Quaternion(), 5))
@example(JointReport(1.0, {"hip": 1.0}, {}, {}, JointTags(source_subtype=5)))
@example(JointReport(1.0, {"hip": 1.0}))
@example(JointReport(1.0, {"hip": 1.0}, [], 0))
def test_a_report_is_refused_exactly_when_a_field_is_not_of_its_type(report):
    assert refused(report) is not fits(report)


@pytest.mark.parametrize("wrong", [True, "5", None, [1.0], 10**30])
def test_what_is_no_number_is_no_coordinate(wrong):
    for place in range(3):
        vector = Vector3(*(wrong if place == axis else 0.5 for axis in range(3)))
        assert refused(PoseReport(1.0, vector, Quaternion()))
        assert refused(ImuReport(1.0, vector, Vector3()))
        assert refused(ImuReport(1.0, Vector3(), vector))
    for place in range(4):
        turn = Quaternion(*(wrong if place == part else 0.5 for part in range(4)))
        assert refused(PoseReport(1.0, Vector3(), turn))
    assert refused(JointReport(1.0, {"hip": 0.5, "knee": wrong}))
    for report in (PoseReport(wrong, Vector3(), Quaternion()), ImuReport(wrong, Vector3(), Vector3())):
        assert refused(report)


@pytest.mark.parametrize("number", [0.0, 5, math.nan, math.inf])
def test_any_number_is_one_whether_it_is_finite_is_asked_where_it_is_written(number):
    assert not refused(PoseReport(1.0, Vector3(number), Quaternion()))
    assert not refused(JointReport(1.0, {"hip": number}))


def test_a_joint_has_a_name():
    assert refused(JointReport(1.0, {5: 0.5}))
    assert refused(JointReport(1.0, {"hip": 0.5}, {"hip": "fast"}))
