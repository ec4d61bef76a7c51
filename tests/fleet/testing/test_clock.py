import pytest

from fleet.testing.clock import ManualClock


def test_time_stands_still_until_it_is_turned():
    clock = ManualClock(monotonic=10.0, time=100.0)
    assert (clock.monotonic(), clock.time()) == (10.0, 100.0)
    clock.advance(2.5)
    assert (clock.monotonic(), clock.time()) == (12.5, 102.5)


def test_setting_the_wall_clock_lets_no_time_pass():
    clock = ManualClock(monotonic=10.0, time=100.0)
    clock.step(-50.0)
    assert (clock.monotonic(), clock.time()) == (10.0, 50.0)


def test_time_does_not_run_backwards():
    with pytest.raises(ValueError, match="backwards"):
        ManualClock().advance(-1.0)
