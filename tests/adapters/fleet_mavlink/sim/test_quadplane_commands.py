"""Commands of a QuadPlane."""

import pytest

ACCEPTED, DENIED, FAILED = 0, 2, 4
GUIDED, QLOITER = 15, 19
UP = (7, (0, 0, 0, 0), 0.0, 0.0, -30.0)  # MAV_FRAME_LOCAL_OFFSET_NED, 30 m up


@pytest.fixture
def armed(bench):
    it = bench("ardupilot", vehicle="vtol")
    it.run(0.5)
    it.set_param("Q_GUIDED_MODE", 1)
    it.requests(176, 1, GUIDED)
    assert it.requests(400, 1) == [ACCEPTED]
    return it


@pytest.fixture
def hovering(armed):
    assert armed.requests_int(22, *UP) == [ACCEPTED]
    armed.until(lambda: armed.height > 29.5)
    return armed


def test_it_takes_off_by_an_offset_once_and_in_guided_only(armed):
    assert armed.requests_int(22, 3, (0, 0, 0, 0), 0.0, 0.0, 30.0) == [DENIED]
    armed.requests(176, 1, QLOITER)
    assert armed.requests_int(22, *UP) == [FAILED]
    assert "User Takeoff only in GUIDED mode" in armed.texts
    armed.requests(176, 1, GUIDED)
    assert armed.requests_int(22, *UP) == [ACCEPTED]
    armed.until(lambda: armed.height > 5.0)
    assert armed.requests_int(22, *UP) == [FAILED]
    assert "Already flying - no takeoff" in armed.texts


def test_it_hovers_to_a_near_position_and_stands_there(hovering):
    place = (47.397742 + 20 / 111_195, 8.545594, 30.0)
    assert hovering.requests_int(192, 6, (-1, 1, 0, 0), *place) == [ACCEPTED]
    hovering.until(lambda: abs(hovering.body.north - 20.0) < 1.0 and hovering.body.speed < 0.5)
    assert hovering.pilot.vtol_state() == 3


def test_a_quadplane_takes_a_transition_by_command_in_auto_only(hovering):
    assert hovering.requests(3000, 4) == [FAILED]
