"""A clock that is wrong, and one that nobody sets."""

import pytest

from fleet.doctor.clock import KernelClock, check_clock, read_clock
from fleet.doctor.finding import Rating

NOW = 1_800_000_000.0


@pytest.mark.parametrize(
    ("clock", "now", "verdict", "words"),
    [
        (KernelClock(synchronised=True, offset=0.001), NOW, Rating.OK, "offset \\+1.0 ms"),
        (KernelClock(synchronised=False), NOW, Rating.WARNING, "not synchronised"),
        (KernelClock(synchronised=True, offset=-0.8), NOW, Rating.ERROR, "-0.80 s off"),
        (KernelClock(synchronised=True), 0.0, Rating.ERROR, "before 2026"),
        (None, NOW, Rating.UNKNOWN, "does not say"),
    ],
)
def test_a_clock_is_judged(clock, now, verdict, words):
    found = check_clock(clock, now)
    assert found.verdict is verdict
    assert words.replace("\\", "") in found.found
    assert verdict is Rating.OK or "timedatectl" in found.cure


def test_the_clock_of_this_computer_can_be_read():
    clock = read_clock()
    assert clock is None or abs(clock.offset) < 10
