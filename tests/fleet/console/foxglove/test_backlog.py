"""What waits for a viewer: all of it in order, or the newest of each channel."""

import pytest

from fleet.console.foxglove.backlog import LATE, MOST_BYTES, Backlog
from fleet.console.foxglove.channels import Sample


@pytest.fixture
def backlog():
    return Backlog()


def numbers(samples):
    return [(sample.channel, sample.received) for sample in samples]


def test_a_viewer_that_reads_gets_everything_in_order(backlog):
    for number in range(100):
        backlog.add(Sample(number % 3, number, b"x"), 0.01 * number)
    assert numbers(backlog.take()) == [(number % 3, number) for number in range(100)]
    assert (bool(backlog), backlog.lost) == (False, 0)


def test_a_slow_one_gets_the_newest_of_each_channel_and_the_number_of_the_others(backlog):
    for number in range(10):
        backlog.add(Sample(number % 3, number, b"x"), 0.0)
    backlog.add(Sample(0, 10, b"x"), LATE + 0.1)
    assert numbers(backlog.take()) == [(1, 7), (2, 8), (0, 9), (0, 10)]
    assert backlog.lost == 7


def test_memory_is_bounded_however_fast_samples_come(backlog):
    for number in range(100):
        backlog.add(Sample(1, number, bytes(MOST_BYTES // 4)), 0.0)
    kept = backlog.take()
    assert kept[-1].received == 99
    assert len(kept) <= 4
    assert len(kept) + backlog.lost == 100
