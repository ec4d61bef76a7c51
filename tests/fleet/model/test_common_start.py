"""Whether the clocks of several processes agree well enough to start their robots together."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import Refused
from fleet.model.common_start import CLOCKS_WITHIN, ClockOffset, check_clock, offset_of

TIMES = st.floats(0, 2e9)


@pytest.mark.parametrize(
    ("sent", "shown", "received", "seconds", "bound"),
    [
        (100.0, 100.0, 100.0, 0.0, 0.0),
        (100.0, 100.005, 100.01, 0.0, 0.005),
        (100.0, 105.0, 100.01, 4.995, 0.005),
        (100.0, 95.0, 102.0, -6.0, 1.0),
        (100.0, 100.0, 99.0, 0.5, 0.0),
    ],
)
def test_a_clock_is_compared_with_the_middle_of_the_request(sent, shown, received, seconds, bound):
    offset = offset_of(sent, shown, received)
    assert (offset.seconds, offset.bound) == (pytest.approx(seconds), pytest.approx(bound))


@given(TIMES, st.floats(-5, 5), st.floats(0, 2), st.floats(0, 2))
def test_the_true_offset_is_within_the_bound(sent, ahead, there, back):
    offset = offset_of(sent, sent + there + ahead, sent + there + back)
    assert abs(offset.seconds - ahead) <= offset.bound + 1e-6
    assert abs(ahead) <= offset.worst + 1e-6


@pytest.mark.parametrize(
    ("offset", "worst"),
    [(ClockOffset(0.01, 0.002), 0.012), (ClockOffset(-0.01, 0.002), 0.012), (ClockOffset(0.0, 0.5), 0.5)],
)
def test_the_worst_difference_is_in_either_direction_with_the_error(offset, worst):
    assert offset.worst == pytest.approx(worst)


@pytest.mark.parametrize(
    "offset", [ClockOffset(0, 0), ClockOffset(CLOCKS_WITHIN, 0), ClockOffset(-0.01, 0.01)]
)
def test_a_clock_that_agrees_is_taken(offset):
    check_clock("arms", offset)


@pytest.mark.parametrize(
    ("offset", "said"),
    [
        (ClockOffset(0.0205, 0.0), "the clock of arms is +20 ms from ours (within 0 ms), 20 ms are the most"),
        (
            ClockOffset(-0.25, 0.004),
            "the clock of arms is -250 ms from ours (within 4 ms), 20 ms are the most",
        ),
        (ClockOffset(0.0, 0.021), "the clock of arms is +0 ms from ours (within 21 ms), 20 ms are the most"),
    ],
)
def test_a_clock_that_may_differ_too_much_starts_no_robot(offset, said):
    with pytest.raises(Refused) as caught:
        check_clock("arms", offset)
    assert caught.value.reason == f"{said}: no robot is started"
    assert caught.value.hint == "synchronise the clocks, by NTP or PTP"


def test_a_process_that_does_not_answer_starts_no_robot():
    with pytest.raises(Refused, match="arms does not report its time: no robot is started"):
        check_clock("arms", None)
