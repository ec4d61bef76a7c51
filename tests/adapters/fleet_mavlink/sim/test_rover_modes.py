"""Modes of ArduRover 4.6.3: which brake, which coast, and which drive."""

import math

import pytest

ACCEPTED = 0
HOLD, LOITER, GUIDED = 4, 5, 15
AHEAD = 0x0DC7


def stopped_after(it, speed=0.1):
    """Let it stop; return metres and seconds."""
    north, east = it.body.north, it.body.east
    took = it.until(lambda: it.body.speed <= speed, limit=12.0)
    return math.hypot(it.body.north - north, it.body.east - east), took


@pytest.mark.parametrize(
    ("mode", "metres", "seconds"), [(HOLD, 6.9, 6.8), (LOITER, 5.4, 2.8)], ids=["hold", "loiter"]
)
def test_it_brakes_by_a_mode_as_the_recorded_one(rover, mode, metres, seconds):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.body.speed == pytest.approx(3.45, abs=0.1)
    assert rover.requests(176, 1, mode) == [ACCEPTED]
    went, took = stopped_after(rover)
    assert went == pytest.approx(metres, abs=0.8)
    assert took == pytest.approx(seconds, abs=0.8)


def test_guided_again_is_no_stop(rover):
    rover.stream(4.0, 3.0, mask=AHEAD)
    assert rover.requests(176, 1, GUIDED) == [ACCEPTED]
    rover.run(2.0)
    assert rover.body.speed > 3.0
