"""A QuadPlane on ArduPlane 4.6.3: its flight states, and GUIDED by its parameter."""

import pytest

ACCEPTED = 0
MODES = {"GUIDED": 15, "QLOITER": 19}


def enters(it, name):
    return it.requests(176, 1, MODES[name])


@pytest.fixture
def plane(bench):
    it = bench("ardupilot", vehicle="plane")
    it.run(0.5)
    assert enters(it, "GUIDED") == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]
    return it


@pytest.fixture
def hovering(bench):
    it = bench("ardupilot", vehicle="vtol")
    it.run(0.5)
    it.set_param("Q_GUIDED_MODE", 1)
    enters(it, "GUIDED")
    assert it.requests(400, 1) == [ACCEPTED]
    assert it.requests_int(22, 7, (0, 0, 0, 0), 0.0, 0.0, -30.0) == [ACCEPTED]
    it.until(lambda: it.height > 29.5)
    it.run(2.0)
    return it


def test_a_quadplane_tells_forward_flight_on_the_ground_and_its_hover_in_the_air(bench, hovering):
    on_the_ground = bench("ardupilot", vehicle="vtol")
    on_the_ground.run(0.5)
    assert (on_the_ground.pilot.vtol_state(), hovering.pilot.vtol_state()) == (4, 3)


def test_a_hovering_quadplane_sinks_in_qloiter_without_a_stick(hovering):
    before = hovering.height
    enters(hovering, "QLOITER")
    hovering.run(4.0)
    assert before - hovering.height > 7.0


def test_a_hovering_quadplane_stands_in_guided_if_it_is_set_so_and_else_flies_forward(hovering):
    enters(hovering, "QLOITER")
    enters(hovering, "GUIDED")
    hovering.run(10.0)
    assert hovering.body.speed < 0.5
    enters(hovering, "QLOITER")
    hovering.set_param("Q_GUIDED_MODE", 0)
    enters(hovering, "GUIDED")
    hovering.run(10.0)
    assert hovering.body.speed > 10.0
    assert hovering.pilot.vtol_state() == 4
