"""Home of the simulated vehicles: heights count from it."""

import pytest

ACCEPTED = 0


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_heights_count_from_where_the_vehicle_was_put_down_until_home_is_known(bench, flavour):
    it = bench(flavour, ready_after=None)
    assert not it.pilot.home.known
    assert it.pilot.home.ned() == (0.0, 0.0, 0.0)
    assert it.pilot.home.height() == 0.0


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_home_set_in_flight_zeroes_the_height_and_is_sent(bench, flavour):
    it = bench(flavour)
    it.climb()
    assert it.pilot.home.height() == pytest.approx(10.0, abs=0.3)
    assert it.requests(179, 1) == [ACCEPTED]
    assert it.pilot.home.height() == pytest.approx(0.0, abs=0.05)
    assert it.last("HOME_POSITION").altitude / 1000 == pytest.approx(498.0, abs=0.3)
